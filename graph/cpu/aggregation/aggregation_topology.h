// Who sends to whom in the form that sums of activations take: no lists of pairs or edges, for receivers find their
// senders by the cells' links.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sparsegrid/hierarchy.h"

namespace graupel::graph {

/// Rebuilt every frame; keeps its memory.
struct AggregationTopology {
  static constexpr int corners = 8;
  using Children = std::array<int32_t, corners>;

  std::vector<int32_t> order;       ///< [n] particle of a sorted place: sorted by base cell, ties by number
  std::vector<int32_t> base_begin;  ///< [level-0 cells + 1] sorted places of the particles with this base cell
  std::vector<std::vector<Children>> children;  ///< [level][cells], by octant, -1 for none; none at level 0

  void build(const sparsegrid::Hierarchy<3>& hierarchy);
};

}  // namespace graupel::graph
