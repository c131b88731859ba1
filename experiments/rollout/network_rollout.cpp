#include "experiments/rollout/network_rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "compare/metrics/position_error.h"
#include "core/system/error.h"
#include "experiments/models/bundle_times.h"
#include "experiments/models/timed_run.h"
#include "experiments/models/trained_materials.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "experiments/rollout/rollout_input.h"
#include "graph/learned_simulator.h"
#include "nn/trained_box.h"

namespace graupel::experiments {

namespace {

/// How far a rollout is from the rest of the trajectory that it started from.
struct RolloutError {
  std::size_t frames = 0;     ///< compared
  double first = 0, all = 0;  ///< position MSE [m^2] of the first 20 frames, and of all
};
constexpr std::size_t first_frames = 20;

/// The start's rest is used up.
RolloutError error_of(Trajectory& trajectory, RolloutStart& start) {
  if (start.rest.empty()) return {};
  compare::ParticleRun truth, run;
  truth.trajectory.particle_type = trajectory.particle_type;
  truth.trajectory.frames.push_back(trajectory.frames.front());
  run.trajectory = std::move(trajectory);
  for (std::size_t f = 0; f < start.rest.size(); ++f) {
    ParticleFrame& frame = truth.trajectory.frames.emplace_back();
    frame.position = std::move(start.rest[f]);
    frame.active = std::move(start.rest_active[f]);
  }
  const auto curve = compare::position_error_curve(truth, run);
  trajectory = std::move(run.trajectory);
  return {curve.size(), compare::mean_of_first(curve, first_frames), compare::mean_of_first(curve, curve.size())};
}

void check_scene(const RolloutStart& start, const RolloutOptions& options) {
  if (start.scene.domain.is_plane() && options.density_limit.value_or(0) > 0)
    throw ConfigError(fmt::format(
        "--density-limit {} is for scenes in space, and '{}' has two dimensions (allowed there: 0). Leave it out",
        *options.density_limit, options.input));
}

/// Throws ConfigError where --start does not fit the network or the input.
void check_start(const RolloutOptions& options, int history) {
  const std::string truth = "truth:" + std::to_string(history);
  if (options.start != "scene" && options.start != truth)
    throw ConfigError("--start '" + options.start + "' is not usable with these weights (allowed: scene, " + truth +
                      ")");
  if (options.start != "scene" && !is_trajectory(options.input))
    throw ConfigError("--start " + options.start + " needs a trajectory (.h5) as input, not a scene");
}

graph::LearnedSimulator::RolloutOptions simulator_options(const RolloutOptions& options, const RolloutStart& start,
                                                          Device device) {
  graph::LearnedSimulator::RolloutOptions run;
  const int64_t given = options.start == "scene" ? start.scene.frames : static_cast<int64_t>(start.rest.size());
  run.frames = options.frames >= 0 ? options.frames : given;
  run.project = !options.no_project;
  run.density_limit = options.density_limit.value_or(run.density_limit);
  run.free_flight = !options.no_free_flight && !start.unknown_gravity;
  run.given = &start.rest;
  run.schedule = &start.schedule;
  run.material = start.material;
  run.active = start.active;
  run.start_time = start.time;
  run.device = device;
  if (start.unknown_gravity && !options.no_free_flight)
    std::fprintf(stderr,
                 "rollout: the data do not say their gravity, so that free flight is left to the network; "
                 "--set gravity=[0,-9.8,0] says it\n");
  return run;
}

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
    std::fprintf(stderr, "position MSE against '%s': %.3g m^2 over %zu frames, %.3g m^2 over %zu\n",
                 options.input.c_str(), error.first, std::min(error.frames, first_frames), error.all, error.frames);
    json["compared_frames"] = error.frames;
    json["position_mse_20"] = error.first;
    json["position_mse_all"] = error.all;
  }
  options.common.write_json(json);
}

}  // namespace

void rollout_network(const RolloutOptions& options, Device device) {
  const graph::LearnedSimulator simulator(options.weights);
  const int history = static_cast<int>(simulator.config().history) + 1;
  check_start(options, history);
  RolloutStart start = rollout_start(options, history, simulator.config().material_constants);
  check_scene(start, options);
  if (nn::TrainedBox::load(simulator.weights()).is_told())
    for (const std::string& line : training_remarks(simulator.weights(), start.scene))
      std::fprintf(stderr, "graupel: warning: %s\n", line.c_str());
  const graph::Environment environment(start.scene);
  graph::LearnedSimulator::RolloutOptions run = simulator_options(options, start, device);
  Progress progress(fmt::format("rollout {} ({} particles)", start.scene.name, start.particle_type.size()), run.frames);
  BundleTimes times(simulator.config().bundle, run.frames);
  run.progress = [&](int64_t frame, const graph::FrameTiming& timing) {
    stop_if_interrupted();
    times.add(frame, timing.total());
    progress.update(frame, fmt::format("{:.0f} ms a frame", 1e3 * timing.total()));
  };
  Trajectory trajectory = simulator.rollout(start.scene, environment, start.particle_type, start.history, run);
  if (trajectory.diverged_at_frame < 0) progress.done();
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
