// From predicted accelerations to the next frame's positions, the same in rollouts and in the evaluation of training.
#pragma once

#include <vector>

#include "graph/features/features.h"

namespace graupel::graph {

/// v' = v + a, x' = x + v' in frame units, with v the difference of `current` and the frame `before` it (all [n]).
/// False when the rollout has diverged: a particle leaves the finite numbers, or moves farther than the longest edge of
/// the scene's domain; `next` is of no use then.
bool step_frame(const Scene& scene, const std::vector<Vec3f>& before, const std::vector<Vec3f>& current,
                const std::vector<Vec3f>& acceleration, std::vector<Vec3f>& next);

}  // namespace graupel::graph
