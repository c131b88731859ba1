// Which obstacles a look-up must ask: lists by coarse cells, for host and device.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "core/math/mat.h"

namespace graupel::sparsegrid {

struct ObstacleView;

/// Places of obstacles in their set, ascending; `place` is null where all of 0 .. count - 1 are meant.
struct ObstacleList {
  const int32_t* place;
  int32_t count;

  template <typename Body>
  GRAUPEL_HD void for_each(Body&& body) const {
#ifdef __CUDA_ARCH__
    for (int32_t k = 0; k < count; ++k) body(place == nullptr ? k : place[k]);  // a second body would cost registers
#else
    if (place == nullptr)
      for (int32_t k = 0; k < count; ++k) body(k);
    else
      for (int32_t k = 0; k < count; ++k) body(place[k]);
#endif
  }
};

/// Where the cells lie, in the precision of a look-up.
template <typename T>
struct CellFrame {
  Vec<T, 3> origin;  ///< [m]
  T inverse_spacing;
};

/// Cells over a box, x fastest; points beyond it count in the outermost ones. An obstacle is in the lists of all cells
/// that have points of its box (ObstacleFrame), wherever they are: of others a look-up need not know.
struct ObstacleCells {
  CellFrame<double> exact;
  CellFrame<float> single;
  Vec<int, 3> size;      ///< cells along each axis
  const int32_t* begin;  ///< [cells + 1] of the cells' lists in `place`; null: every point asks all obstacles
  const int32_t* place;  ///< of obstacles in their set, ascending in each list

  template <typename T>
  GRAUPEL_HD const CellFrame<T>& frame() const {
    if constexpr (std::is_same_v<T, float>)
      return single;
    else
      return exact;
  }

  /// Place of a coordinate among the cells of an axis; never falls as x grows, rounding included. NaN: 0.
  template <typename T>
  GRAUPEL_HD int32_t along(int axis, T x) const {
    const CellFrame<T>& own = frame<T>();
    const T u = (x - own.origin[axis]) * own.inverse_spacing, last = static_cast<T>(size[axis] - 1);
    return static_cast<int32_t>(u > T(0) ? (u < last ? u : last) : T(0));
  }

  template <typename T>
  GRAUPEL_HD ObstacleList near(const Vec<T, 3>& x) const {
    return list({along(0, x[0]), along(1, x[1]), along(2, x[2])});
  }
  GRAUPEL_HD ObstacleList list(const Vec<int32_t, 3>& at) const {
    const int32_t cell = (at[2] * size[1] + at[1]) * size[0] + at[0];
    const int32_t first = begin[cell];
    return {place + first, begin[cell + 1] - first};
  }
};

/// With fewer obstacles it is as fast to ask all of them.
inline constexpr std::size_t fewest_listed_obstacles = 12;

/// Lists in host memory; the pointers of `cells` are null.
struct ObstacleLists {
  ObstacleCells cells{};
  std::vector<int32_t> begin, place;
};

/// Lists over the box low .. high [m], where look-ups are expected, of obstacles of one band. Those with `moves` may
/// lie anywhere. Empty where they would spare little: for few obstacles, or those that are everywhere.
ObstacleLists list_obstacles(const std::vector<ObstacleView>& obstacles, const std::vector<bool>& moves,
                             const Vec3d& low, const Vec3d& high);

}  // namespace graupel::sparsegrid
