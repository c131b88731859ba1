// A rollout of coarse MPM with trained constants.
#pragma once

#include "core/parallel/device.h"
#include "experiments/rollout/rollout.h"

namespace graupel::experiments {

/// Runs it from the scene's start and writes the places of the scene's own particles. Throws DivergedError once the
/// frames before the divergence are written.
void rollout_coarse(const RolloutOptions& options, Device device);

}  // namespace graupel::experiments
