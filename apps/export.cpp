// graupel export: trajectory -> files that other programs read.
#include <cstdio>
#include <filesystem>

#include "experiments/process/common_options.h"
#include "apps/verbs.h"
#include "core/system/command_line.h"
#include "core/system/error.h"
#include "io/export/export.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::apps {

namespace {

struct ExportOptions {
  CommonOptions common;
  std::string input, output, format = "vtp";
  int trajectory = 0;
};

void export_trajectory(ExportOptions& options) {
  options.common.apply();
  const io::TrajectoryReader reader(options.input);
  if (options.trajectory < 0 || options.trajectory >= reader.count())
    throw ConfigError("--trajectory " + std::to_string(options.trajectory) + " is not in '" + options.input +
                      "' (allowed: 0 to " + std::to_string(reader.count() - 1) + ")");
  const Trajectory trajectory = reader.read(options.trajectory);
  const std::string name = std::filesystem::path(options.input).stem();
  const std::string folder = options.output.empty() ? name + "_" + options.format : options.output;
  if (options.format == "vtp") io::export_vtp(trajectory, folder, name);
  if (options.format == "ply") io::export_ply(trajectory, folder, name);
  if (options.format == "vdb") io::export_vdb_points(trajectory, folder, name);
  std::fprintf(stderr, "%s: %zu frames of %zu particles as .%s\n", folder.c_str(), trajectory.frame_count(),
               trajectory.particle_count(), options.format.c_str());
}

}  // namespace

void add_export(CLI::App& app) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* verb = app.add_subcommand("export", "Write a trajectory for ParaView, Blender, Houdini");
  verb->add_option("trajectory", options->input, "Trajectory or data-set file (.h5)")->required();
  verb->add_option("-f,--format", options->format, "vtp (with .pvd), ply or vdb (points)")
      ->check(CLI::IsMember({"vtp", "ply", "vdb"}))
      ->capture_default_str();
  verb->add_option("-o,--output", options->output, "Folder; default NAME_FORMAT");
  verb->add_option("--trajectory", options->trajectory, "Which trajectory of a data set")
      ->check(whole_number(0))
      ->capture_default_str();
  options->common.add_to(*verb);
  verb->footer(
      "Examples:\n  graupel export steps.h5 --format vtp -o steps_vtp\n  graupel export data/hgn/test.h5 --trajectory "
      "3 --format ply");
  verb->callback([options] { export_trajectory(*options); });
}

}  // namespace graupel::apps
