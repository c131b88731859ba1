// Where a line in z goes through a triangle. Of a closed mesh a line crosses as often upwards as downwards, to the bit.
#pragma once

#include <optional>
#include <utility>

#include "core/math/vec.h"

namespace graupel::sparsegrid {

struct LineCrossing {
  double z;
  int32_t turn;  ///< +1 where the triangle faces down: the winding number grows with z
};

/// Whether (x, y) lies left of the line from a to b: both triangles of an edge get opposite answers. On the line the
/// answer is that of a point shifted by (-e^2, e) with an infinitesimal e, so that vertices count once as well.
inline bool is_left(const Vec3d& a, const Vec3d& b, double x, double y) {
  const bool runs_up = std::pair(a[0], a[1]) < std::pair(b[0], b[1]);
  const Vec3d &from = runs_up ? a : b, &to = runs_up ? b : a;
  return ((to[0] - from[0]) * (y - from[1]) - (to[1] - from[1]) * (x - from[0]) >= 0) == runs_up;
}

inline std::optional<LineCrossing> crossing(const Vec3d& a, const Vec3d& b, const Vec3d& c, double x, double y) {
  const bool left = is_left(a, b, x, y);
  if (is_left(b, c, x, y) != left || is_left(c, a, x, y) != left) return std::nullopt;
  const Vec3d normal = cross(b - a, c - a);
  if (normal[2] == 0) return std::nullopt;
  return LineCrossing{a[2] - (normal[0] * (x - a[0]) + normal[1] * (y - a[1])) / normal[2], left ? -1 : 1};
}

}  // namespace graupel::sparsegrid
