// Rollouts of all trajectories of a data set by a graph network: many at once on a GPU.
#pragma once

#include "core/parallel/device.h"
#include "experiments/rollout/rollout.h"
#include "graph/learned_simulator.h"

namespace graupel::experiments {

/// Writes a data set of as many trajectories in the same order, prints and reports times and errors. Throws as
/// rollout_network; DivergedError, with the trajectories that diverged, once all are written.
void rollout_data_set(const graph::LearnedSimulator& simulator, const RolloutOptions& options, Device device);

}  // namespace graupel::experiments
