#include "graph/topology/graph_topology.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "graph/topology/tiles.h"
#include "sparsegrid/cell_list.h"
#include "sparsegrid/radius_graph.h"

namespace graupel::graph {

namespace {

/// Particles with many neighbours: tiles of as many rows of products.
constexpr int32_t particles_in_tile = 16;

/// Receivers are put together until a tile has its rows; small levels get small tiles, so that there is work for some
/// threads. Depends on the groups alone.
void split_tiles(const std::vector<int32_t>& begin, std::vector<int32_t>& tile) {
  const int32_t target = std::clamp(begin.back() / 8, 16, tile_rows);
  const auto receivers = static_cast<int32_t>(begin.size()) - 1;
  tile.assign(1, 0);
  int32_t rows = 0;
  for (int32_t i = 0; i < receivers; ++i) {
    const int32_t more = begin[i + 1] - begin[i];
    if (tile.back() < i && (rows + more > target || i - tile.back() >= target)) {
      tile.push_back(i);
      rows = 0;
    }
    rows += more;
  }
  if (receivers > 0) tile.push_back(receivers);
}

void build_edges(const sparsegrid::HierarchyLevel<3>& cells, HostLinks& links) {
  for (auto* list : {&links.sender, &links.receiver, &links.slot}) list->clear();
  links.edge_begin.assign(1, 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (int32_t slot = 0; slot < 6; ++slot) {
      if (cells.neighbor[c][slot] < 0) continue;
      links.sender.push_back(cells.neighbor[c][slot]);
      links.receiver.push_back(static_cast<int32_t>(c));
      links.slot.push_back(slot);
    }
    links.edge_begin.push_back(static_cast<int32_t>(links.sender.size()));
  }
  links.cells = static_cast<int64_t>(cells.size());
  links.edges = static_cast<int64_t>(links.sender.size());
  split_tiles(links.edge_begin, links.edge_tile);
}

}  // namespace

void list_by_receiver(const std::vector<int32_t>& receiver, std::size_t receivers, std::vector<int32_t>& begin,
                      std::vector<int32_t>& list) {
  begin.assign(receivers + 1, 0);
  for (const int32_t r : receiver) ++begin[static_cast<std::size_t>(r) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int32_t> cursor(begin.begin(), begin.end() - 1);
  list.resize(receiver.size());
  for (std::size_t i = 0; i < receiver.size(); ++i)
    list[static_cast<std::size_t>(cursor[static_cast<std::size_t>(receiver[i])]++)] = static_cast<int32_t>(i);
}

void GraphTopology::build_order(const sparsegrid::Hierarchy<3>& hierarchy) {
  std::vector<int32_t> base;
  base.reserve(hierarchy.cell.size());
  for (const auto& cell : hierarchy.cell) base.push_back(cell[0]);
  list_by_receiver(base, hierarchy.levels[0].size(), base_begin, order);
  levels.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l + 1 < levels.size(); ++l) {
    HostLinks& links = levels[l];
    list_by_receiver(hierarchy.levels[l].parent, hierarchy.levels[l + 1].size(), links.child_begin, links.child);
    split_tiles(links.child_begin, links.child_tile);
  }
}

void GraphTopology::build(const sparsegrid::Hierarchy<3>& hierarchy) {
  build_order(hierarchy);
  std::vector<int32_t> cell;
  cell.reserve(8 * order.size());
  for (const int32_t p : order)
    for (const int32_t c : hierarchy.cell[static_cast<std::size_t>(p)]) cell.push_back(c);
  list_by_receiver(cell, hierarchy.levels[0].size(), pair_begin, pair);
  split_tiles(pair_begin, pair_tile);
  for (std::size_t l = 0; l < levels.size(); ++l) build_edges(hierarchy.levels[l], levels[l]);
}

void GraphTopology::build(const std::vector<Vec3f>& unsorted, double radius) {
  order = sparsegrid::CellList(unsorted, radius).point();
  position.clear();
  for (const int32_t p : order) position.push_back(unsorted[static_cast<std::size_t>(p)]);
  auto graph = sparsegrid::build_radius_graph(position, radius, sparsegrid::SelfEdges::with);
  levels.resize(1);
  HostLinks& links = levels[0];
  links.cells = graph.points();
  links.edges = graph.edges();
  links.receiver.resize(graph.sender.size());
  links.edge_tile.clear();
  for (int32_t r = 0; r < graph.points(); ++r) {
    std::fill(links.receiver.begin() + graph.begin[static_cast<std::size_t>(r)],
              links.receiver.begin() + graph.begin[static_cast<std::size_t>(r) + 1], r);
    if (r % particles_in_tile == 0) links.edge_tile.push_back(r);
  }
  links.edge_tile.push_back(graph.points());
  links.edge_begin = std::move(graph.begin);
  links.sender = std::move(graph.sender);
}

}  // namespace graupel::graph
