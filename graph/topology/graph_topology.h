// Who sends to whom on the host: the pairs and edges of a grid hierarchy or of a radius graph as sorted lists, so that
// every sum is a gather by its receiver in a fixed order, without atomics.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "graph/topology/level_graph.h"
#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

/// Items 0, 1, .. by their receivers: those of receiver r are list[begin[r]] to list[begin[r + 1] - 1], ascending.
void list_by_receiver(const std::vector<int32_t>& receiver, std::size_t receivers, std::vector<int32_t>& begin,
                      std::vector<int32_t>& list);

/// The links of a level in host memory. Parents and octants are the hierarchy's; reverse edges are not wanted.
struct HostLinks : LevelGraph<std::vector<int32_t>> {
  std::vector<int32_t> edge_tile;   ///< receivers [edge_tile[t], edge_tile[t + 1]) make tile t
  std::vector<int32_t> child_tile;  ///< the same of the next level's cells
};

/// Rebuilt every frame; keeps its memory.
struct GraphTopology {
  std::vector<int32_t> order;       ///< [n] particle of a sorted place: sorted by cell, ties by number
  std::vector<int32_t> base_begin;  ///< [level-0 cells + 1] sorted places of the particles with this base cell
  std::vector<Vec3f> position;      ///< [n] in sorted order; of a radius graph
  std::vector<int32_t> pair_begin;  ///< [level-0 cells + 1] pairs by receiving cell
  std::vector<int32_t> pair;        ///< [8 n] 8 * sorted place of the particle + corner
  std::vector<int32_t> pair_tile;
  std::vector<HostLinks> levels;

  /// Order and children alone: for receivers that find their senders by the cells' links.
  void build_order(const sparsegrid::Hierarchy<3>& hierarchy);
  /// And the lists of pairs and edges.
  void build(const sparsegrid::Hierarchy<3>& hierarchy);
  /// Edges between all particles within the radius, each particle's edge to itself included, as those of one level.
  void build(const std::vector<Vec3f>& unsorted, double radius);
};

}  // namespace graupel::graph
