// Training samples turned and mirrored: a scene's physics is the same under every permutation and reflection of the
// axes that leaves gravity alone (eight of them where gravity points along an axis), so each frame serves eight times.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/axis_map.h"
#include "core/math/random.h"

namespace graupel::train {

/// All maps with S gravity = gravity, the identity first; of a scene with two dimensions those that leave z alone.
std::vector<AxisMap> symmetries_of(const Vec3d& gravity, int64_t dimensions = 3);
/// One of them, each as likely, from draw 0 of `random`.
AxisMap draw_symmetry(const Vec3d& gravity, int64_t dimensions, const Random& random);

/// A box [low, high] turned about the origin.
void apply_to_box(const AxisMap& symmetry, Vec3d& low, Vec3d& high);

}  // namespace graupel::train
