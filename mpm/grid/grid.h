// Geometry of the sparse grid: nodes in blocks of 4^D, found through a dense directory of blocks (one integer a block),
// and the arena, the nodes that the particles of one block touch.
//
// A particle's owner block holds its base node. Its stencil reaches two or three nodes further, into the upper
// neighbours, so that all particles of a block touch 6^D (quadratic) or 7^D (cubic) nodes: the arena. Rows of an arena
// (last axis) are padded to 8 nodes, so that a stencil row is 4 nodes x 4 channels, for the quadratic spline with
// weight 0 for the fourth.
//
// The plane of a two-dimensional run lies in one layer of blocks, on its nodes with z index 1: kernels that know
// positions only work in space in both cases; those that know nodes do without the z axis (in_axes).
#pragma once

#include <cmath>
#include <cstdint>

#include "core/math/mat.h"
#include "core/scene/scene.h"
#include "mpm/bspline.h"

namespace graupel::mpm {

inline constexpr int block_width = 4;
inline constexpr int plane_node = 1;  ///< z index of the nodes of a plane run
/// Nodes along an axis that the particles of a block touch.
template <Spline S = Spline::quadratic>
inline constexpr int arena_width = block_width + stencil_width<S> - 1;
inline constexpr int arena_row = 8;  ///< nodes of a padded row
inline constexpr int channels = 4;   ///< momentum or velocity x, y, z (unused in 2-D: zero), mass

template <int D>
inline constexpr int nodes_per_block = D == 2 ? 16 : 64;
template <int D, Spline S = Spline::quadratic>
inline constexpr int arena_size = (D == 2 ? arena_width<S> : arena_width<S> * arena_width<S>)*arena_row* channels;
template <int D>
inline constexpr int upper_neighbors = 1 << D;  ///< the block itself and its upper neighbours

/// Blocks of the whole domain; `directory index` numbers them with the last axis fastest.
template <typename T, int D>
struct GridGeometry {
  Vec<T, D> origin;  ///< position of node 0 [m]
  T dx, inverse_dx;  ///< [m], [1/m]
  Vec<int, D> blocks;

  GRAUPEL_HD int64_t directory_size() const {
    int64_t n = 1;
    for (int d = 0; d < D; ++d) n *= blocks[d];
    return n;
  }
  GRAUPEL_HD int32_t directory_index(const Vec<int, D>& block) const {
    int32_t index = 0;
    for (int d = 0; d < D; ++d) index = index * blocks[d] + block[d];
    return index;
  }
  GRAUPEL_HD Vec<int, D> block_of(int32_t index) const {
    Vec<int, D> block;
    for (int d = D - 1; d >= 0; --d) {
      block[d] = index % blocks[d];
      index /= blocks[d];
    }
    return block;
  }
  /// Position in cells from node 0.
  GRAUPEL_HD Vec<T, D> local(const Vec<T, D>& x) const { return (x - origin) * inverse_dx; }
  GRAUPEL_HD Vec<T, D> node_position(const Vec<int, D>& node) const {
    Vec<T, D> x;
    for (int d = 0; d < D; ++d) x[d] = origin[d] + static_cast<T>(node[d]) * dx;
    return x;
  }
};

/// Node number inside its block -> coordinates 0..3.
template <int D>
GRAUPEL_HD inline Vec<int, D> node_in_block(int node) {
  Vec<int, D> c;
  for (int d = D - 1; d >= 0; --d) {
    c[d] = node % block_width;
    node /= block_width;
  }
  return c;
}

/// First channel of a node in the arena.
template <Spline S = Spline::quadratic, int D>
GRAUPEL_HD inline int arena_offset(const Vec<int, D>& c) {
  int row = c[0];
  for (int d = 1; d < D - 1; ++d) row = row * arena_width<S> + c[d];
  return (row * arena_row + c[D - 1]) * channels;
}

/// Bit d of `corner` as coordinates: 0 this block, 1 the upper neighbour along axis d.
template <int D>
GRAUPEL_HD inline Vec<int, D> corner_bits(int corner) {
  Vec<int, D> c;
  for (int d = 0; d < D; ++d) c[d] = (corner >> d) & 1;
  return c;
}

/// Number of grid cells along an axis, rounded up.
inline int64_t cell_count(double size, double dx) { return static_cast<int64_t>(std::ceil(size / dx - 1e-6)); }

/// The first D components or axes of a vector, a matrix or a grid, and a vector or matrix with zeros for the others.
template <int D, typename T>
GRAUPEL_HD inline Vec<T, D> in_axes(const Vec<T, 3>& v) {
  if constexpr (D == 3)
    return v;
  else
    return {v[0], v[1]};
}
template <int D, typename T>
GRAUPEL_HD inline Mat<T, D> in_axes(const Mat<T, 3>& m) {
  if constexpr (D == 3)
    return m;
  else
    return {{{m(0, 0), m(0, 1)}, {m(1, 0), m(1, 1)}}};
}
template <int D, typename T>
GRAUPEL_HD inline GridGeometry<T, D> in_axes(const GridGeometry<T, 3>& grid) {
  return {in_axes<D>(grid.origin), grid.dx, grid.inverse_dx, in_axes<D>(grid.blocks)};
}
template <typename T, int D>
GRAUPEL_HD inline Vec<T, 3> in_space(const Vec<T, D>& v) {
  if constexpr (D == 3)
    return v;
  else
    return {v[0], v[1], T(0)};
}
template <typename T, int D>
GRAUPEL_HD inline Mat<T, 3> in_space(const Mat<T, D>& m) {
  if constexpr (D == 3)
    return m;
  else
    return {{{m(0, 0), m(0, 1), T(0)}, {m(1, 0), m(1, 1), T(0)}, {T(0), T(0), T(0)}}};
}

/// Where node `inside` of the block with directory index `key` lies [m].
template <int D, typename T>
GRAUPEL_HD inline Vec<T, 3> node_position(const GridGeometry<T, 3>& grid, int32_t key, int inside) {
  const Vec<int, D> node = node_in_block<D>(inside), block = in_axes<D>(grid).block_of(key);
  Vec<int, 3> at = {0, 0, plane_node};
  for (int d = 0; d < D; ++d) at[d] = block_width * block[d] + node[d];
  return grid.node_position(at);
}

/// Grid of a scene's domain: every particle inside the walls (at least two cells from the faces) finds its stencil.
template <typename T>
GridGeometry<T, 3> grid_of(const Domain& domain) {
  GridGeometry<T, 3> grid;
  grid.origin = domain.origin.cast<T>();
  grid.dx = static_cast<T>(domain.dx);
  grid.inverse_dx = static_cast<T>(1 / domain.dx);
  for (int d = 0; d < domain.axes(); ++d)
    grid.blocks[d] = static_cast<int>((cell_count(domain.size[d], domain.dx) + 1) / block_width) + 2;
  if (!domain.is_plane()) return grid;
  grid.origin[2] = static_cast<T>(domain.plane() - plane_node * domain.dx);
  grid.blocks[2] = 1;
  return grid;
}

}  // namespace graupel::mpm
