#include "experiments/rollout/network_rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/system/error.h"
#include "experiments/models/bundle_times.h"
#include "experiments/models/timed_run.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/rollout/data_set_rollout.h"
#include "experiments/rollout/network_start.h"

namespace graupel::experiments {

namespace {

/// Prints what was run and, where the input goes on after the start, how far it is from that; writes it to --json.
void report(const RolloutOptions& options, const Trajectory& trajectory, const RolloutError& error,
            const std::vector<double>& seconds) {
  const double middle = median(seconds);
  std::fprintf(stderr, "%s: %zu particles, %zu frames, %s a frame (median)\n", options.output.c_str(),
               trajectory.particle_count(), trajectory.frame_count() - 1, human_time(middle).c_str());
  nlohmann::ordered_json json = {{"output", options.output},
                                 {"particles", trajectory.particle_count()},
                                 {"frames", trajectory.frame_count() - 1},
                                 {"seconds_per_frame", middle},
                                 {"diverged_at_frame", trajectory.diverged_at_frame}};
  if (error.frames > 0) {
    std::fprintf(stderr, "position MSE against '%s'%s: %s over %zu frames, %s over %zu\n", options.input.c_str(),
                 options.set.empty() ? "" : " (a run without --set)", mse_text(error.first).c_str(),
                 std::min(error.frames, first_frames), mse_text(error.all).c_str(), error.frames);
    json["compared_frames"] = error.frames;
    json["position_mse_20"] = mse_json(error.first);
    json["position_mse_all"] = mse_json(error.all);
  }
  options.common.write_json(json);
}

}  // namespace

void rollout_network(const RolloutOptions& options, Device device) {
  const graph::LearnedSimulator simulator(options.weights);
  if (options.all) return rollout_data_set(simulator, options, device);
  const int history = static_cast<int>(simulator.config().history) + 1;
  check_start(options, history);
  RolloutStart start = rollout_start(options, history, simulator.config().material_constants);
  check_scene(start, options);
  for (const std::string& line : remarks_on(simulator, start.scene)) warn(line);
  const graph::Environment environment(start.scene);
  graph::LearnedSimulator::RolloutOptions run = simulator_options(options, start, device);
  if (leaves_free_flight(options, start)) std::fprintf(stderr, "rollout: %s\n", free_flight_remark);
  Progress progress(fmt::format("rollout {} ({} particles)", start.scene.name, start.particle_type.size()), run.frames);
  BundleTimes times(simulator.config().bundle, run.frames);
  run.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    stop_if_interrupted();
    times.add(frame, timing.total());
    progress.update(frame, fmt::format("{:.0f} ms a frame", 1e3 * timing.total()));
  };
  Trajectory trajectory = simulator.rollout(start.scene, environment, start.particle_type, start.history, run);
  if (trajectory.diverged_at_frame < 0) progress.done();
  trajectory.materials = start.kept_materials;
  trajectory.seed = start.seed;
  trajectory.made_by = options.weights;
  write_positions(options.output, trajectory);
  const RolloutError error = error_of(trajectory, start);
  report(options, trajectory, error, times.times());
  if (trajectory.diverged_at_frame >= 0)
    throw DivergedError(fmt::format("the rollout diverged at frame {}; the frames before it are in '{}'",
                                    trajectory.diverged_at_frame, options.output));
}

}  // namespace graupel::experiments
