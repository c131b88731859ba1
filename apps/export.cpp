// graupel export: trajectory -> files that other programs read.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/verbs.h"
#include "core/system/error.h"
#include "experiments/process/common_options.h"
#include "experiments/process/outputs.h"
#include "io/export/export.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::apps {

using namespace experiments;

namespace {

struct ExportOptions {
  CommonOptions common;
  std::string input, output, format = "vtp";
  int trajectory = 0;
};

void export_forces(const ExportOptions& options, const io::TrajectoryReader& reader, const std::string& name) {
  io::ForceTable table;
  table.names = reader.contact_names(options.trajectory);
  table.forces = reader.contact_forces(options.trajectory);
  if (table.names.empty())
    throw InputError("'" + options.input +
                     "' stores no forces on obstacles and walls. Make it by graupel simulate SCENE --forces");
  for (const ParticleFrame& frame : reader.header(options.trajectory).frames) table.times.push_back(frame.time);
  const std::string file = options.output.empty() ? name + "_forces.csv" : options.output;
  check_output_file(file);
  check_apart({{"the trajectory", options.input}}, {{"--output", file}});
  io::export_forces(table, file);
  std::fprintf(stderr, "%s: forces on %zu obstacles and walls in %zu frames\n", file.c_str(), table.names.size(),
               table.times.size());
}

void export_trajectory(ExportOptions& options) {
  options.common.apply();
  const io::TrajectoryReader reader(options.input);
  if (options.trajectory < 0 || options.trajectory >= reader.count())
    throw ConfigError("--trajectory " + std::to_string(options.trajectory) + " is not in '" + options.input +
                      "' (allowed: 0 to " + std::to_string(reader.count() - 1) + ")");
  const std::string name = std::filesystem::path(options.input).stem();
  if (options.format == "csv") return export_forces(options, reader, name);
  const Trajectory trajectory = reader.read(options.trajectory);
  const std::string folder = options.output.empty() ? name + "_" + options.format : options.output;
  if (options.format == "vtp") io::export_vtp(trajectory, folder, name);
  if (options.format == "ply") io::export_ply(trajectory, folder, name);
  if (options.format == "vdb") io::export_vdb_points(trajectory, folder, name);
  std::fprintf(stderr, "%s: %zu frames of %zu particles as .%s\n", folder.c_str(), trajectory.frame_count(),
               trajectory.particle_count(), options.format.c_str());
}

}  // namespace

void add_export(const Command& app) {
  auto options = std::make_shared<ExportOptions>();
  const Command verb = app.command("export", "Write a trajectory for ParaView, Blender, Houdini");
  verb.option("trajectory", options->input, "Trajectory or data-set file (.h5)").required();
  verb.option("-f,--format", options->format, "vtp (with .pvd), ply or vdb (points); csv (forces, one file)")
      .check(one_of({"vtp", "ply", "vdb", "csv"}))
      .show_default();
  verb.option("-o,--output", options->output, "Folder; default NAME_FORMAT (csv: file; default NAME_forces.csv)");
  verb.option("--trajectory", options->trajectory, "Which trajectory of a data set")
      .check(whole_number(0))
      .show_default();
  options->common.add_to(verb);
  verb.footer(
      "Examples:\n  graupel export steps.h5 --format vtp -o steps_vtp\n  graupel export data/hgn/test.h5 --trajectory "
      "3 --format ply");
  verb.callback([options] { export_trajectory(*options); });
}

}  // namespace graupel::apps
