#include "experiments/rollout/network_start.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "compare/metrics/position_error.h"
#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "experiments/models/trained_materials.h"
#include "nn/trained_box.h"

namespace graupel::experiments {

namespace {

/// Whether a particle counts in one of the frames 1 to `frames`: it moves by itself and is in both runs.
bool any_counts(const compare::ParticleRun& truth, const compare::ParticleRun& run, std::size_t frames) {
  for (std::size_t f = 1; f <= frames; ++f)
    for (std::size_t i = 0; i < run.size(); ++i)
      if (moves_by_itself(run.trajectory.particle_type[i]) && truth.is_active(f, i) && run.is_active(f, i)) return true;
  return false;
}

}  // namespace

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
  const auto mean = [&](std::size_t frames) {
    return any_counts(truth, run, std::min(frames, curve.size())) ? std::optional(compare::mean_of_first(curve, frames))
                                                                  : std::nullopt;
  };
  RolloutError error{curve.size(), mean(first_frames), mean(curve.size())};
  trajectory = std::move(run.trajectory);
  return error;
}

std::string mse_text(const std::optional<double>& error) {
  return error ? fmt::format("{:.3g} m^2", *error) : "no particle to compare";
}

nlohmann::ordered_json mse_json(const std::optional<double>& error) {
  return error ? nlohmann::ordered_json(*error) : nlohmann::ordered_json();
}

void check_scene(const RolloutStart& start, const RolloutOptions& options) {
  if (start.scene.domain.is_plane() && options.density_limit.value_or(0) > 0)
    throw ConfigError(fmt::format(
        "--density-limit {} is for scenes in space, and '{}' has two dimensions (allowed there: 0). Leave it out",
        *options.density_limit, options.input));
}

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
  return run;
}

bool leaves_free_flight(const RolloutOptions& options, const RolloutStart& start) {
  return start.unknown_gravity && !options.no_free_flight;
}

std::vector<std::string> remarks_on(const graph::LearnedSimulator& simulator, const Scene& scene) {
  if (!nn::TrainedBox::load(simulator.weights()).is_told()) return unknown_forces(scene);
  return training_remarks(simulator.weights(), scene);
}

}  // namespace graupel::experiments
