// The space of a scene as the metrics see it: two or three axes, some of which close on themselves at periodic walls.
#pragma once

#include <cmath>

#include "core/scene/periodic_walls.h"

namespace graupel::compare {

struct Space {
  int axes = 3;              ///< 2 in the plane
  Vec3d low = {0, 0, 0};     ///< lower walls [m]
  Vec3d period = {0, 0, 0};  ///< from wall to wall of a periodic axis; 0 of the others [m]

  Space() = default;
  explicit Space(const Domain& domain) : axes(domain.axes()), low(domain.wall_low()), period(period_of(domain)) {}

  bool is_periodic(int axis) const { return period[axis] > 0; }
  /// The shortest way from b to a [m].
  Vec3d difference(const Vec3d& a, const Vec3d& b) const {
    Vec3d way = a - b;
    for (int d = 0; d < 3; ++d)
      if (is_periodic(d)) way[d] -= period[d] * std::round(way[d] / period[d]);
    return way;
  }
};

}  // namespace graupel::compare
