// What open and periodic walls do: which walls hold the material, and how far apart the periodic ones are.
#pragma once

#include "core/scene/domain.h"

namespace graupel {

/// Whether material stays on this side of a wall; it passes open and periodic ones.
constexpr bool holds_material(Wall wall) { return wall != Wall::open && wall != Wall::periodic; }

/// Distances between the periodic walls of a domain [m]; 0 along axes without them.
inline Vec3d period_of(const Domain& domain) {
  Vec3d period = Vec3d::zero();
  for (int axis = 0; axis < domain.axes(); ++axis)
    if (domain.wall(axis, 0) == Wall::periodic) period[axis] = domain.wall_high()[axis] - domain.wall_low()[axis];
  return period;
}

}  // namespace graupel
