// Active cells, trilinear weights and the links between cells and levels (HGN paper, section 3.2).
#include "sparsegrid/hierarchy.h"

#include <cmath>
#include <string>

#include "core/system/error.h"
#include "sparsegrid/cell_table.h"

namespace graupel::sparsegrid {

namespace {

constexpr int coordinate_limit = (1 << 20) - 2;  ///< leaves room for the upper corner and a neighbour

template <int D>
struct Bounds {
  Vec<int, D> low = Vec<int, D>::zero(), high = Vec<int, D>::zero();
  void add(const Vec<int, D>& cell, bool first) {
    for (int d = 0; d < D; ++d) {
      low[d] = first ? cell[d] : std::min(low[d], cell[d]);
      high[d] = first ? cell[d] : std::max(high[d], cell[d]);
    }
  }
};

template <int D>
Vec<int, D> corner_of(const Vec<int, D>& base, int corner) {
  Vec<int, D> cell = base;
  for (int d = 0; d < D; ++d) cell[d] += corner >> d & 1;
  return cell;
}

/// Base cell, offset and weights of every particle; returns the bounds of the base cells.
template <int D>
Bounds<D> locate(const std::vector<Vec<float, D>>& position, Hierarchy<D>& h, std::vector<Vec<int, D>>& base) {
  Bounds<D> bounds;
  const double inverse = 1 / h.spacing;
  for (std::size_t p = 0; p < position.size(); ++p) {
    for (int d = 0; d < D; ++d) {
      const double u = (static_cast<double>(position[p][d]) - h.origin[d]) * inverse - 0.5;
      const double cell = std::floor(u);
      if (!(std::abs(cell) < coordinate_limit))
        throw ConfigError("a particle is too far from the grid's origin (particle " + std::to_string(p) + ", " +
                          std::to_string(position[p][d]) + " m, at most 2^20 cells of " + std::to_string(h.spacing) +
                          " m). Check the positions or choose a larger spacing");
      base[p][d] = static_cast<int>(cell);
      h.offset[p][d] = static_cast<float>(u - cell);
    }
    bounds.add(base[p], p == 0);
    for (int k = 0; k < Hierarchy<D>::corners; ++k) {
      float w = 1;
      for (int d = 0; d < D; ++d) w *= k >> d & 1 ? h.offset[p][d] : 1 - h.offset[p][d];
      h.weight[p][k] = w;
    }
  }
  return bounds;
}

/// Neighbours and octants of the cells of a level.
template <int D>
void link_level(const CellTable<D>& table, HierarchyLevel<D>& level) {
  level.neighbor.resize(level.size());
  level.octant.resize(level.size());
  for (std::size_t c = 0; c < level.size(); ++c) {
    int octant = 0;
    for (int d = 0; d < D; ++d) {
      octant |= (level.coordinate[c][d] & 1) << d;
      for (int side = 0; side < 2; ++side) {
        Vec<int, D> cell = level.coordinate[c];
        cell[d] += 2 * side - 1;
        level.neighbor[c][2 * d + side] = table.find(cell);
      }
    }
    level.octant[c] = static_cast<uint8_t>(octant);
  }
}

/// The next coarser level over `fine`, whose parents are set.
template <int D>
HierarchyLevel<D> coarsen(HierarchyLevel<D>& fine) {
  std::vector<Vec<int, D>> parent(fine.size());
  Bounds<D> bounds;
  for (std::size_t c = 0; c < fine.size(); ++c) {
    for (int d = 0; d < D; ++d) parent[c][d] = fine.coordinate[c][d] >> 1;  // floor, also below zero
    bounds.add(parent[c], c == 0);
  }
  CellTable<D> table(bounds.low, bounds.high, fine.size());
  for (const auto& cell : parent) table.insert(cell);
  HierarchyLevel<D> level;
  level.coordinate = table.number_cells();
  link_level(table, level);
  fine.parent.resize(fine.size());
  for (std::size_t c = 0; c < fine.size(); ++c) fine.parent[c] = table.find(parent[c]);
  return level;
}

}  // namespace

template <int D>
Hierarchy<D> build_hierarchy(const std::vector<Vec<float, D>>& position, double spacing, const Vec<double, D>& origin,
                             int n_levels) {
  if (!(spacing > 0)) throw ConfigError("the grid spacing is not positive (" + std::to_string(spacing) + " m)");
  if (n_levels < 1 || n_levels > 20)
    throw ConfigError("the number of grid levels is out of range (" + std::to_string(n_levels) + ", allowed 1 to 20)");
  Hierarchy<D> h;
  h.spacing = spacing;
  h.origin = origin;
  h.cell.resize(position.size());
  h.weight.resize(position.size());
  h.offset.resize(position.size());
  std::vector<Vec<int, D>> base(position.size());
  const Bounds<D> bounds = locate(position, h, base);

  CellTable<D> table(bounds.low, bounds.high + Vec<int, D>::filled(1), Hierarchy<D>::corners * position.size());
  for (std::size_t p = 0; p < base.size(); ++p) {
    if (p > 0 && base[p] == base[p - 1]) continue;
    for (int k = 0; k < Hierarchy<D>::corners; ++k) table.insert(corner_of<D>(base[p], k));
  }
  h.levels.resize(static_cast<std::size_t>(n_levels));
  h.levels[0].coordinate = table.number_cells();
  link_level(table, h.levels[0]);
  for (std::size_t p = 0; p < base.size(); ++p)
    for (int k = 0; k < Hierarchy<D>::corners; ++k) h.cell[p][k] = table.find(corner_of<D>(base[p], k));
  for (int l = 1; l < n_levels; ++l) h.levels[l] = coarsen(h.levels[l - 1]);
  return h;
}

template Hierarchy<2> build_hierarchy<2>(const std::vector<Vec<float, 2>>&, double, const Vec<double, 2>&, int);
template Hierarchy<3> build_hierarchy<3>(const std::vector<Vec<float, 3>>&, double, const Vec<double, 3>&, int);

}  // namespace graupel::sparsegrid
