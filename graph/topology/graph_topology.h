// Who sends to whom: the pairs and edges of a grid hierarchy as sorted lists, so that every sum is a gather by its
// receiver in a fixed order, without atomics.
#pragma once

#include <cstdint>
#include <vector>

#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

/// Items [begin[i], begin[i + 1]) belong to receiver i.
struct Groups {
  std::vector<int32_t> begin;  ///< [receivers + 1]
  int32_t receivers() const { return static_cast<int32_t>(begin.size()) - 1; }
  int32_t items() const { return begin.back(); }
};

/// One (particle, cell) pair; `particle` counts in sorted order.
struct ParticlePair {
  int32_t particle;
  int32_t corner;
};

/// One directed edge of a level, at its receiver.
struct Edge {
  int32_t sender;
  int32_t direction;  ///< neighbour slot of the receiver, 0..5: the sender lies at -x, +x, -y, +y, -z, +z
};

struct LevelTopology {
  Groups edges_in;                 ///< edges by receiving cell
  std::vector<Edge> edges;         ///< in slot order
  std::vector<int32_t> edge_tile;  ///< cells [edge_tile[t], edge_tile[t + 1]) make tile t
  Groups children_of;              ///< fine cells by parent; empty at level 0
  std::vector<int32_t> children;   ///< cells of the level below, ascending
  std::vector<int32_t> child_tile;
};

/// Rebuilt every frame; keeps its memory.
struct GraphTopology {
  std::vector<int32_t> order;  ///< [n] particle of a sorted place: sorted by base cell, ties by number
  Groups pairs_in;             ///< pairs by receiving level-0 cell
  std::vector<ParticlePair> pairs;
  std::vector<int32_t> pair_tile;
  std::vector<LevelTopology> levels;

  void build(const sparsegrid::Hierarchy<3>& hierarchy);
};

}  // namespace graupel::graph
