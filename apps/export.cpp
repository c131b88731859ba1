// graupel export: trajectory -> files that other programs read.
#include <memory>
#include <string>

#include "apps/verbs.h"
#include "experiments/export/export_run.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct ExportVerb {
  CommonOptions common;
  ExportRequest request;
};

}  // namespace

void add_export(const Command& app) {
  auto verb = std::make_shared<ExportVerb>();
  ExportRequest& request = verb->request;
  const Command command =
      app.command("export", "Write a trajectory for ParaView, Blender, Houdini; films and pictures");
  command.option("trajectory", request.input, "Trajectory or data-set file (.h5)").names_file({".h5"}).required();
  command
      .option("-f,--format", request.format,
              "Particles: vtp (with .pvd), ply, vdb, bgeo, usda; with --surface: obj, ply, vtp, vdb, usda; pictures: "
              "png, gif, mp4; csv: forces on obstacles and walls, one file")
      .check(one_of(export_formats()))
      .show_default();
  command.option("-o,--output", request.folder, "Folder; default NAME_FORMAT (csv: file; default NAME_forces.csv)")
      .names_file({".csv", ".mp4", ".gif"})
      .names_folder();
  command.option("--name", request.name, "Of the files; default the trajectory file's");
  command.option("--trajectory", request.trajectory, "Which trajectory of a data set")
      .check(whole_number(0))
      .show_default();
  command.option("--frames", request.frames, "FIRST:LAST:STRIDE, each optional; or one frame. Default all");
  command.flag("--surface", request.surface, "The materials' surfaces, a mesh or level set each, instead of particles");
  command
      .option("--radius", request.radius,
              "Of the spheres about particles that make the surface [m]; default 1.5 times their spacing, 0.75 dx "
              "with 8 in a cell")
      .check(real_number(LowerBound::above_zero));
  command.option("--voxel", request.voxel, "Of the surface's level set [m]; default half of the spacing")
      .check(real_number(LowerBound::above_zero));
  command.option("--smoothing", request.smoothing, "Passes of mean curvature flow over the surface; default 3")
      .check(whole_number(0, 100));
  command.option("--rate", request.rate, "Pictures of a film a second; default as the run's frames, at most 60")
      .check(real_number(1, 240));
  command.option("--width", request.width, "Of pictures, even [pixels]")
      .check(whole_number(64, 7680))
      .show_default(std::to_string(default_width));
  command.option("--height", request.height, "Of pictures, even [pixels]")
      .check(whole_number(64, 4320))
      .show_default(std::to_string(default_height));
  verb->common.add_without_run_to(command);
  command.footer(
      "Examples:\n  graupel export steps.h5 --format vtp -o steps_vtp\n"
      "  graupel export steps.h5 --surface --format usda --frames 0:60:2\n"
      "  graupel export steps.h5 --format mp4\n"
      "  graupel export data/hgn/test.h5 --trajectory 3 --format ply");
  command.callback([verb] { run_export(verb->request, verb->common); });
}

}  // namespace graupel::apps
