// What a graph network's rollouts start from, alone and of a data set: checks, options, and the error at the end.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "experiments/rollout/rollout.h"
#include "experiments/rollout/rollout_input.h"
#include "graph/learned_simulator.h"

namespace graupel::experiments {

/// How far a rollout is from the rest of the trajectory that it started from.
struct RolloutError {
  std::size_t frames = 0;            ///< compared
  std::optional<double> first, all;  ///< position MSE [m^2] of the first 20 frames, and of all; none without a particle
};
constexpr std::size_t first_frames = 20;

/// The start's rest is used up.
RolloutError error_of(Trajectory& trajectory, RolloutStart& start);

/// "1.2e-05 m^2" or "no particle to compare"; as JSON a number or null.
std::string mse_text(const std::optional<double>& error);
nlohmann::ordered_json mse_json(const std::optional<double>& error);

/// Throws ConfigError for a density limit in two dimensions.
void check_scene(const RolloutStart& start, const RolloutOptions& options);
/// Throws ConfigError where --start does not fit the network or the input.
void check_start(const RolloutOptions& options, int history);

/// `start` must live as long as the options.
graph::LearnedSimulator::RolloutOptions simulator_options(const RolloutOptions& options, const RolloutStart& start,
                                                          Device device);
/// Whether the momentum of what flies is left to the network against the options, which free_flight_remark says.
bool leaves_free_flight(const RolloutOptions& options, const RolloutStart& start);
inline constexpr const char* free_flight_remark =
    "the data do not say their gravity, so that free flight is left to the network; --set gravity=[0,-9.8,0] says it";

/// What of a scene the network was not trained on, as far as the weights tell, and forces that it cannot know.
std::vector<std::string> remarks_on(const graph::LearnedSimulator& simulator, const Scene& scene);

}  // namespace graupel::experiments
