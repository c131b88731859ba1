// The obstacles at rest as the grid sees them: which nodes obey a contact law, with the normal there, computed once.
// Kept by block; blocks far from every surface take one integer.
//
// A node obeys the law of its nearest obstacle where phi < 0. At a plate thinner than a cell no node may lie inside;
// there the nodes within dx/2 of the surface obey it, from both sides.
#pragma once

#include "mpm/grid/grid.h"
#include "mpm/particles/particles.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

inline constexpr int32_t block_without_surface = -1;

/// An outward normal; in a plane run the direction in which the obstacle's section is left, or zero where none is
/// known.
template <int D, typename T>
GRAUPEL_HD inline Vec<T, 3> normal_in_axes(Vec<T, 3> normal) {
  if constexpr (D == 2) {
    normal[2] = T(0);
    normal = norm2(normal) > T(1e-6) ? normalized(normal) : Vec<T, 3>::zero();
  }
  return normal;
}

/// For kernels. Node n of a block with number b has entry 64 b + n (16 b + n in the plane).
template <typename T>
struct ObstacleNodeView {
  sparsegrid::ObstacleSetView obstacles;
  const int32_t* block_number;  ///< [directory] or block_without_surface
  const T* phi;                 ///< signed distance of the union [m]
  const Vec<T, 3>* normal;      ///< of the nearest obstacle (normal_in_axes); zero deep inside
  const int32_t* law;           ///< index of the obstacle whose contact law holds; -1 for none
};

template <typename T>
class ObstacleNodes {
 public:
  ObstacleNodes() = default;
  ObstacleNodes(Device device, const GridGeometry<T, 3>& grid, const sparsegrid::ObstacleSetView& obstacles,
                int dimensions = 3);

  ObstacleNodeView<T> view() const;
  int64_t bytes() const;

 private:
  sparsegrid::ObstacleSetView obstacles_{};
  Buffer<int32_t> block_number_, law_;
  Buffer<T> phi_;
  Buffer<Vec<T, 3>> normal_;
};

}  // namespace graupel::mpm
