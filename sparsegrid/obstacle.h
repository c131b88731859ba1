// Signed distance to obstacles from NanoVDB views, for host and device kernels. Each obstacle keeps its grid in its own
// frame; the pose is applied at look-up.
#pragma once

#include <nanovdb/NanoVDB.h>

#include <type_traits>

#include "core/math/mat.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_cells.h"

/// Kernels that look up seldom, in many places, are compiled with GRAUPEL_COMPACT_LOOKUP: a look-up is then called. Its
/// code in every place would not fit into a GPU's instruction cache.
#if defined(GRAUPEL_COMPACT_LOOKUP) && defined(__CUDA_ARCH__)
#define GRAUPEL_LOOKUP __noinline__
#else
#define GRAUPEL_LOOKUP
#endif

namespace graupel::sparsegrid {

/// Signed distance phi [m] (negative inside) and outward unit normal (zero beyond the narrow band) at a world point.
template <typename T>
struct SignedDistance {
  T phi;
  Vec<T, 3> normal;
};

/// The values of a grid in a box of voxels, z fastest, for look-ups without a search; null where there are none.
struct DenseValues {
  const float* values;
  Vec<int, 3> low, size;  ///< [voxels]
};

/// Where an obstacle lies, in the precision of a look-up.
template <typename T>
struct ObstacleFrame {
  Mat<T, 3> rotation;               ///< x_world = rotation x_local + position
  Vec<T, 3> position;               ///< [m]
  T inverse_voxel;                  ///< [1/m]
  T band;                           ///< |phi| is clamped to this [m]
  Vec<T, 3> low, high;              ///< world box outside which phi = band [m]
  Vec<T, 3> solid_low, solid_high;  ///< world box outside which phi > 0 [m]
};

/// One obstacle: grid in its own frame, pose, contact law. `grid` points to memory of the device that reads it.
struct ObstacleView {
  const nanovdb::FloatGrid* grid;
  ObstacleFrame<double> exact;
  ObstacleFrame<float> single;  ///< the same rounded, boxes outwards: a GPU converts slowly
  Contact contact;
  double friction;
  DenseValues dense;  ///< around the solid (GPUs)
  bool is_plane;      ///< phi is the local y, without bound; the grid holds its part in the domain

  /// Changes the frame, in both precisions.
  void set_frame(const ObstacleFrame<double>& frame);

  template <typename T>
  GRAUPEL_HD const ObstacleFrame<T>& frame() const {
    if constexpr (std::is_same_v<T, float>)
      return single;
    else
      return exact;
  }
};

/// All obstacles of a scene; their bands are equal.
struct ObstacleSetView {
  const ObstacleView* obstacles;
  int count;
  ObstacleCells cells = {};  ///< without lists, every look-up asks all obstacles; the answer is the same

  /// The obstacles that x may lie within the band of.
  template <typename T>
  GRAUPEL_HD ObstacleList near(const Vec<T, 3>& x) const {
    return cells.begin == nullptr ? ObstacleList{nullptr, count} : cells.near(x);
  }
  /// Those that points of the box low .. high [m] may lie within the band of; one may come several times.
  template <typename T, typename Body>
  GRAUPEL_HD void for_each_near(const Vec<T, 3>& low, const Vec<T, 3>& high, Body&& body) const {
    if (cells.begin == nullptr) return ObstacleList{nullptr, count}.for_each(body);
    int32_t first[3], last[3];
    for (int d = 0; d < 3; ++d) {
      first[d] = cells.along(d, low[d]);
      last[d] = cells.along(d, high[d]);
    }
    for (int32_t z = first[2]; z <= last[2]; ++z)
      for (int32_t y = first[1]; y <= last[1]; ++y)
        for (int32_t x = first[0]; x <= last[0]; ++x) cells.list({x, y, z}).for_each(body);
  }
};

/// phi and normal of one obstacle: trilinear interpolation of the grid and the gradient of that interpolant.
template <typename T>
GRAUPEL_LOOKUP GRAUPEL_HD SignedDistance<T> signed_distance(const ObstacleView& obstacle, const Vec<T, 3>& x);

/// Largest difference of a grid's values at neighbouring voxels [voxels]; grids are built so.
inline constexpr double steepest_grid = 1.1;

/// phi of a set without obstacles [m].
inline constexpr double no_obstacle_distance = 1e30;

/// Signed distance of the union, normal of the nearest obstacle, and its index (-1 when none is within its band).
/// Deeper inside than the band, phi is -band, the normal is zero and the index is that of the obstacle.
template <typename T>
GRAUPEL_HD SignedDistance<T> signed_distance(const ObstacleSetView& set, const Vec<T, 3>& x, int& nearest);

}  // namespace graupel::sparsegrid

#include "sparsegrid/obstacle_impl.h"
