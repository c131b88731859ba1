#include "graph/topology/graph_topology.h"

#include <algorithm>
#include <numeric>

#include "graph/topology/tiles.h"

namespace graupel::graph {

namespace {

/// Counts held in begin[i + 1] become first items.
void sum_up(std::vector<int32_t>& begin) { std::partial_sum(begin.begin(), begin.end(), begin.begin()); }

/// Receivers are put together until a tile has its rows; small levels get small tiles, so that there is work for some
/// threads. Depends on the groups alone.
void split_tiles(const Groups& groups, std::vector<int32_t>& tile) {
  const int32_t target = std::clamp(groups.items() / 8, 16, tile_rows);
  tile.assign(1, 0);
  int32_t rows = 0;
  for (int32_t i = 0; i < groups.receivers(); ++i) {
    const int32_t more = groups.begin[i + 1] - groups.begin[i];
    if (tile.back() < i && (rows + more > target || i - tile.back() >= target)) {
      tile.push_back(i);
      rows = 0;
    }
    rows += more;
  }
  if (groups.receivers() > 0) tile.push_back(groups.receivers());
}

void build_order(const sparsegrid::Hierarchy<3>& hierarchy, std::vector<int32_t>& order) {
  std::vector<int32_t> next(hierarchy.levels[0].size() + 1, 0);
  for (const auto& cell : hierarchy.cell) ++next[static_cast<std::size_t>(cell[0]) + 1];
  sum_up(next);
  order.resize(hierarchy.cell.size());
  for (std::size_t p = 0; p < hierarchy.cell.size(); ++p)
    order[static_cast<std::size_t>(next[static_cast<std::size_t>(hierarchy.cell[p][0])]++)] = static_cast<int32_t>(p);
}

void build_pairs(const sparsegrid::Hierarchy<3>& hierarchy, GraphTopology& topology) {
  auto& begin = topology.pairs_in.begin;
  begin.assign(hierarchy.levels[0].size() + 1, 0);
  for (const auto& cells : hierarchy.cell)
    for (const int32_t cell : cells) ++begin[static_cast<std::size_t>(cell) + 1];
  sum_up(begin);
  topology.pairs.resize(hierarchy.cell.size() * 8);
  std::vector<int32_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t s = 0; s < topology.order.size(); ++s) {
    const auto& cells = hierarchy.cell[static_cast<std::size_t>(topology.order[s])];
    for (int32_t corner = 0; corner < 8; ++corner)
      topology.pairs[static_cast<std::size_t>(next[static_cast<std::size_t>(cells[corner])]++)] = {
          static_cast<int32_t>(s), corner};
  }
  split_tiles(topology.pairs_in, topology.pair_tile);
}

void build_edges(const sparsegrid::HierarchyLevel<3>& cells, LevelTopology& level) {
  level.edges.clear();
  level.edges_in.begin.assign(1, 0);
  for (const auto& neighbors : cells.neighbor) {
    for (int32_t direction = 0; direction < 6; ++direction)
      if (neighbors[direction] >= 0) level.edges.push_back({neighbors[direction], direction});
    level.edges_in.begin.push_back(static_cast<int32_t>(level.edges.size()));
  }
  split_tiles(level.edges_in, level.edge_tile);
}

void build_children(const sparsegrid::HierarchyLevel<3>& fine, std::size_t coarse_cells, LevelTopology& level) {
  auto& begin = level.children_of.begin;
  begin.assign(coarse_cells + 1, 0);
  for (const int32_t parent : fine.parent) ++begin[static_cast<std::size_t>(parent) + 1];
  sum_up(begin);
  std::vector<int32_t> next(begin.begin(), begin.end() - 1);
  level.children.resize(fine.size());
  for (std::size_t c = 0; c < fine.size(); ++c)
    level.children[static_cast<std::size_t>(next[static_cast<std::size_t>(fine.parent[c])]++)] =
        static_cast<int32_t>(c);
  split_tiles(level.children_of, level.child_tile);
}

}  // namespace

void GraphTopology::build(const sparsegrid::Hierarchy<3>& hierarchy) {
  build_order(hierarchy, order);
  build_pairs(hierarchy, *this);
  levels.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels.size(); ++l) {
    build_edges(hierarchy.levels[l], levels[l]);
    if (l > 0) build_children(hierarchy.levels[l - 1], hierarchy.levels[l].size(), levels[l]);
  }
}

}  // namespace graupel::graph
