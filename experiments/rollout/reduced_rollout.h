// A rollout of a reduced-order model.
#pragma once

#include "experiments/rollout/rollout.h"

namespace graupel::experiments {

/// Runs a reduced-order model and writes its trajectory frame by frame. Throws ConfigError for a scene that the model
/// is not for, DivergedError once the frames before the divergence are written.
void rollout_reduced(const RolloutOptions& options);

}  // namespace graupel::experiments
