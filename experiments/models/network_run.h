// Runs a graph network on a scene and measures what that costs.
#pragma once

#include <cstdint>
#include <string>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "experiments/models/model_choice.h"
#include "experiments/models/start_state.h"
#include "experiments/models/timed_run.h"
#include "graph/learned_simulator.h"

namespace graupel::experiments {

/// Laws that rollouts of networks are held to, as in LearnedSimulator::RolloutOptions.
struct HeldLaws {
  double density_limit = 1;
  bool free_flight = true;
  bool project = true;
  bool network = true;
};
/// Those of a rollout with some of its parts, from those of the whole: without corrections particles are not moved out
/// of obstacles and walls either.
HeldLaws laws_of(NetworkParts parts, HeldLaws whole);
/// From frame 0 with a ballistic past.
TimedRun run_network(const graph::LearnedSimulator& simulator, const Scene& scene,
                     const graph::Environment& environment, const StartState& start, int64_t frames, Device device,
                     const std::string& label, const HeldLaws& laws = {});

}  // namespace graupel::experiments
