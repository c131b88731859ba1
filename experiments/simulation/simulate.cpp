#include "experiments/simulation/simulate.h"

#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include "core/system/error.h"
#include "core/system/output_files.h"
#include "experiments/process/file_name.h"
#include "experiments/process/process.h"
#include "experiments/simulation/recorded_run.h"
#include "experiments/simulation/run_estimate.h"
#include "experiments/simulation/saved_run.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/state_file.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

io::TrajectoryWriteOptions SimulateOptions::write_options(const Scene& scene_to_run) const {
  io::TrajectoryWriteOptions write;
  write.velocity = !no_velocity;
  write.active = scene_to_run.has_inactive_particles();
  write.fields = FieldSet::parse(fields);
  if (forces) write.contacts = contact_names(scene_to_run);
  return write;
}

namespace {

mpm::SimulationOptions simulation_options(const SimulateOptions& options, const Scene& scene, Device device) {
  mpm::SimulationOptions simulation;
  simulation.device = device;
  simulation.precision = options.precision == "f64" ? mpm::Precision::f64 : mpm::Precision::f32;
  simulation.contact_forces = options.forces;
  simulation.seed = options.common.seed_given ? options.common.seed : scene.seed;
  return simulation;
}

std::string default_output(const Scene& scene) {
  return file_name_of(scene.name.empty() ? "trajectory" : scene.name) + ".h5";
}

/// Takes from the state what the user left open. Throws InputError where the two differ.
io::SavedRun take_saved_run(SimulateOptions& options) {
  RunRequest wishes;
  if (options.common.device != "auto") wishes.device = options.common.device;
  if (options.precision_given) wishes.precision = options.precision;
  if (options.common.seed_given) wishes.seed = std::to_string(options.common.seed);
  wishes.fields = FieldSet::parse(options.fields).names();
  wishes.no_velocity = options.no_velocity;
  wishes.forces = options.forces;
  io::SavedRun saved = read_saved_run(options.resume, wishes);
  options.common.device = saved.device;
  options.common.seed = saved.seed;
  options.common.seed_given = true;
  options.precision = saved.precision;
  options.fields = saved.fields.names();
  options.no_velocity = !saved.velocity;
  options.forces = saved.forces;
  if (options.output.empty()) options.output = saved.output;
  return saved;
}

/// The scene and the geometry that it names.
std::vector<NamedFile> inputs_of(const SimulateOptions& options, const Scene& scene) {
  std::vector<NamedFile> inputs = {{"the scene", options.scene}};
  for (const Obstacle& obstacle : scene.obstacles) inputs.push_back({"the geometry", obstacle.file});
  for (const Source& source : scene.sources) inputs.push_back({"the geometry", source.file});
  for (const Emitter& emitter : scene.emitters) inputs.push_back({"the geometry", emitter.file});
  return inputs;
}

/// Whether a file is there whose loss would be one.
bool is_file_of_another_kind(const std::string& path) {
  std::error_code none;
  return fs::is_regular_file(path, none) && fs::file_size(path, none) > 0 && !io::is_state_file(path);
}

/// A state may be replaced by a later one of its run, and by nothing else.
void check_outputs(const SimulateOptions& options, const Scene& scene) {
  check_library_output(options.output);
  check_library_output(options.save_state);
  if (!options.write_obstacles.empty()) check_library_output(options.write_obstacles);
  const std::vector<NamedFile> others = {{"--output", options.output},
                                         {"the bad state of --output", options.output + ".blowup.h5"},
                                         {"--write-obstacles", options.write_obstacles},
                                         {"--json", options.common.json}};
  std::vector<NamedFile> all = others;
  all.push_back({"--save-state", options.save_state});
  check_apart(inputs_of(options, scene), all);
  check_apart({{"the state", options.resume}}, others);
  if (!options.save_state.empty() && is_file_of_another_kind(options.save_state))
    throw ConfigError("--save-state '" + options.save_state +
                      "' would overwrite a file that is no saved state. Give it another name");
}

void check_flags(const SimulateOptions& options) {
  if (options.scene.empty() && options.resume.empty())
    throw ConfigError(
        "simulate needs a scene file, or --resume with a saved state. Example: graupel simulate "
        "scenes/shared/water_steps.json -o steps.h5");
  if (options.save_every > 0 && options.save_state.empty())
    throw ConfigError("--save-every needs the file to write (no --save-state given). Add --save-state FILE");
  FieldSet::parse(options.fields);
}

}  // namespace

void simulate(SimulateOptions& options) {
  if (options.print_defaults) {
    if (!options.scene.empty() || !options.set.empty())
      throw ConfigError("--print-defaults prints the keys of every scene with their defaults, and takes none ('" +
                        (options.scene.empty() ? "--set " + options.set.front() : options.scene) +
                        "'). Leave out the scene and --set");
    std::fputs(io::scene_defaults().c_str(), stdout);
    return;
  }
  check_flags(options);
  std::optional<io::SavedRun> saved;
  if (!options.resume.empty()) saved = take_saved_run(options);
  const Device device = options.common.apply();
  options.common.device = name_of(device);
  if (options.frames >= 0) options.set.push_back("frames=" + std::to_string(options.frames));
  const Scene scene =
      saved ? scene_of(*saved, options.resume, options.scene, options.set) : io::read_scene(options.scene, options.set);
  const auto simulation = simulation_options(options, scene, device);
  if (options.dry_run) {
    std::vector<NamedFile> inputs = inputs_of(options, scene);
    inputs.push_back({"the state", options.resume});
    check_apart(inputs, {{"--json", options.common.json}});
    return print_run_estimate(options, scene, simulation);
  }
  if (options.output.empty()) options.output = default_output(scene);
  check_outputs(options, scene);
  if (const std::string remark = remark_on_memory(scene, simulation); !remark.empty()) warn(remark);
  RecordedRun run(options, scene, simulation, saved);
  run.finish();
  run.report();
}

}  // namespace graupel::experiments
