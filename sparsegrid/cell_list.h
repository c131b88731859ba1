// Points sorted into the cubic cells of a sparse grid, to find those near a place without looking at all.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "sparsegrid/cell_table.h"

namespace graupel::sparsegrid {

/// Cell (i, j, k) holds the points with floor(x / size) = (i, j, k); it may lie at negative coordinates. The order
/// depends on the positions alone.
class CellList {
 public:
  /// `size` [m] > 0. Throws ConfigError when a coordinate leaves 2^20 cells or is not a number.
  CellList(const std::vector<Vec3f>& position, double size);

  double size() const { return size_; }
  int32_t count() const { return static_cast<int32_t>(cell_.size()); }
  const Vec3i& cell(int32_t c) const { return cell_[static_cast<std::size_t>(c)]; }  ///< in (z, y, x) order
  /// Number of a cell, -1 where no point lies. `cell` may lie one cell outside the cells that hold points.
  int32_t find(const Vec3i& cell) const { return table_.find(cell); }

  /// Points of cell c: point()[begin(c)] to point()[begin(c + 1) - 1], ascending.
  int32_t begin(int32_t c) const { return begin_[static_cast<std::size_t>(c)]; }
  const std::vector<int32_t>& point() const { return point_; }  ///< [n] a permutation
  /// Cell of point p.
  int32_t cell_of(std::size_t p) const { return cell_of_[p]; }

 private:
  double size_;
  CellTable<3> table_;
  std::vector<Vec3i> cell_;
  std::vector<int32_t> begin_, point_, cell_of_;
};

}  // namespace graupel::sparsegrid
