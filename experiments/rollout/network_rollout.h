// A rollout of a graph network, and how far it is from the trajectory that it started from.
#pragma once

#include "core/parallel/device.h"
#include "experiments/rollout/rollout.h"

namespace graupel::experiments {

/// Runs the network and writes its trajectory at the end. Throws ConfigError for a start that does not fit the weights
/// and for a density limit in two dimensions; DivergedError once the frames before the divergence are written.
void rollout_network(const RolloutOptions& options, Device device);

}  // namespace graupel::experiments
