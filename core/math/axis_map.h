// Permutations and reflections of the three axes.
#pragma once

#include "core/math/vec.h"

namespace graupel {

/// (S v)[d] = sign[d] v[axis[d]], an orthogonal map of the axes onto themselves; the identity unless set.
struct AxisMap {
  int axis[3] = {0, 1, 2};
  int sign[3] = {1, 1, 1};

  template <typename T>
  GRAUPEL_HD Vec<T, 3> apply(const Vec<T, 3>& v) const {
    Vec<T, 3> turned;
    for (int d = 0; d < 3; ++d) turned[d] = static_cast<T>(sign[d]) * v[axis[d]];
    return turned;
  }
  /// The inverse: undo(apply(v)) = v.
  template <typename T>
  GRAUPEL_HD Vec<T, 3> undo(const Vec<T, 3>& turned) const {
    Vec<T, 3> v;
    for (int d = 0; d < 3; ++d) v[axis[d]] = static_cast<T>(sign[d]) * turned[d];
    return v;
  }
};

}  // namespace graupel
