// The grid hierarchy of the HGN paper (section 3.2): the cells of a sparse grid of spacing R whose centres have
// trilinear weights for some particle, and L - 1 coarser levels made by merging 2 x 2 x 2 cells.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace graupel::sparsegrid {

/// Active cells of one level, sorted by (z, y, x) coordinate, so that the numbering depends on the cells alone.
template <int D>
struct HierarchyLevel {
  std::vector<Vec<int, D>> coordinate;               ///< [n_cells] integer cell coordinates, may be negative
  std::vector<std::array<int32_t, 2 * D>> neighbor;  ///< [n_cells, 2 D]: -x, +x, -y, +y, -z, +z; -1 for none
  std::vector<int32_t> parent;                       ///< [n_cells] index into the next level; empty at the top level
  std::vector<uint8_t> octant;                       ///< [n_cells] child slot: bit d = coordinate[d] & 1
  std::size_t size() const { return coordinate.size(); }
};

/// Cells and their links for one set of particles. Cell c of level l is centred at
/// origin + (coordinate + 1/2) * spacing * 2^l.
template <int D>
struct Hierarchy {
  static constexpr int corners = 1 << D;
  double spacing = 0;     ///< R of level 0 [m]
  Vec<double, D> origin;  ///< [m]
  std::vector<HierarchyLevel<D>> levels;
  std::vector<std::array<int32_t, corners>>
      cell;  ///< [n_particles, 2^D] level-0 cells; corner bit d: upper along axis d
  std::vector<std::array<float, corners>> weight;  ///< [n_particles, 2^D] trilinear, sum 1
  std::vector<Vec<float, D>>
      offset;  ///< [n_particles] (x - centre of corner 0) / R in [0, 1]^D; corner k: offset - bits(k)
};

/// Builds the hierarchy of `n_levels` levels over `position` [m]. Base cell floor((x - origin)/R - 1/2), parents by
/// floor(i / 2) (arithmetic shift), parents of active cells only. Throws ConfigError when a coordinate leaves 2^20
/// cells.
template <int D>
Hierarchy<D> build_hierarchy(const std::vector<Vec<float, D>>& position, double spacing, const Vec<double, D>& origin,
                             int n_levels);

extern template Hierarchy<2> build_hierarchy<2>(const std::vector<Vec<float, 2>>&, double, const Vec<double, 2>&, int);
extern template Hierarchy<3> build_hierarchy<3>(const std::vector<Vec<float, 3>>&, double, const Vec<double, 3>&, int);

}  // namespace graupel::sparsegrid
