#include "experiments/simulation/saved_run.h"

#include <fmt/format.h>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "experiments/process/process.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

namespace {

void check_wish(const std::string& file, const char* flag, const std::string& wish, const std::string& had) {
  if (wish.empty() || wish == had) return;
  throw InputError(fmt::format("'{}' is the state of a run with {} {} (asked for: {}). Leave {} out, or start again",
                               file, flag, had.empty() ? "nothing" : had, wish, flag));
}

}  // namespace

io::SavedRun read_saved_run(const std::string& file, const RunRequest& wishes) {
  io::SavedRun saved = io::read_state_file(file);
  if (saved.version != version_text())
    throw InputError(
        fmt::format("'{}' was saved by {}, and this is {}, whose numbers may differ. Resume it with that "
                    "version, or start the run again",
                    file, saved.version, version_text()));
  check_wish(file, "--device", wishes.device, saved.device);
  check_wish(file, "--precision", wishes.precision, saved.precision);
  check_wish(file, "--seed", wishes.seed, std::to_string(saved.seed));
  check_wish(file, "--fields", wishes.fields, saved.fields.names());
  if (wishes.no_velocity && saved.velocity)
    throw InputError(fmt::format("'{}' is the state of a run that stores velocities. Leave --no-velocity out", file));
  if (wishes.forces && !saved.forces)
    throw InputError(
        fmt::format("'{}' is the state of a run that keeps no forces. Leave --forces out, or start again", file));
  if (saved.device == name_of(Device::cuda) && !cuda_available())
    throw InputError(
        fmt::format("'{}' is the state of a run on a GPU, and there is none here. Resume it on a machine "
                    "with one, or start the run again on the CPU",
                    file));
  return saved;
}

Scene scene_of(const io::SavedRun& saved, const std::string& state_file, const std::string& scene_file,
               const std::vector<std::string>& overrides) {
  Scene scene = scene_file.empty()
                    ? io::parse_stored_scene(saved.scene_json, "scene in " + state_file, state_file, overrides)
                    : io::read_scene(scene_file, overrides);
  if (saved.frame > scene.frames)
    throw ConfigError(fmt::format("'{}' is at frame {}, beyond the run's last one ({}). Use --frames with {} or more",
                                  state_file, saved.frame, scene.frames, saved.frame));
  return scene;
}

void restore(mpm::Simulation& run, const io::SavedRun& saved, const std::string& state_file,
             const std::string& scene_file) {
  try {
    run.load_state(saved.state);
  } catch (const InputError& error) {
    const std::string scene = scene_file.empty() ? "" : fmt::format(" '{}'", scene_file);
    throw InputError(fmt::format("cannot resume{} from '{}': {}", scene, state_file, error.what()));
  }
}

io::TrajectoryCheckpoint checkpoint_of(const mpm::Simulation& run, const io::SavedRun& saved) {
  io::TrajectoryCheckpoint checkpoint{saved.frame, saved.recent};
  if (checkpoint.recent.empty()) checkpoint.recent.push_back(mpm::frame_with_fields(run, saved.fields));
  return checkpoint;
}

}  // namespace graupel::experiments
