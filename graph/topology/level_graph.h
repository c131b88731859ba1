// The links of one level of a grid hierarchy, or between particles: who sends to whom. One declaration for every place
// where such links lie: Array is a pointer into host or device memory, a part of a larger array, or a tensor.
#pragma once

#include <cstdint>

namespace graupel::graph {

/// Numbers of cells and edges count within the level; of a batch they run over its scenes. Edges are sorted by
/// receiver, so that a receiver's sum has a fixed order without atomics. Between particles the cells are the particles,
/// and arrays behind `reverse` are empty.
template <typename Array>
struct LevelGraph {
  int64_t cells = 0, edges = 0;
  Array edge_begin{};   ///< [cells + 1] edges by receiver
  Array sender{};       ///< [edges] cell
  Array receiver{};     ///< [edges] cell
  Array reverse{};      ///< [edges] the edge from receiver to sender; as a list, the edges of a sender
  Array slot{};         ///< [edges] 0..5: the sender lies at -x, +x, -y, +y, -z, +z
  Array parent{};       ///< [cells] cell of the next coarser level; empty at the top
  Array octant{};       ///< [cells] child slot 0..7
  Array child_begin{};  ///< [cells of the next level + 1] children by parent
  Array child{};        ///< [cells] this level's cells, sorted by parent

  /// The same links, each array as convert(array).
  template <typename Other, typename Convert>
  LevelGraph<Other> as(const Convert& convert) const {
    return {
        cells,         edges,           convert(edge_begin), convert(sender),      convert(receiver), convert(reverse),
        convert(slot), convert(parent), convert(octant),     convert(child_begin), convert(child)};
  }
};

/// The links of one level in the memory of the device that runs the network.
struct LevelLinks : LevelGraph<const int32_t*> {
  /// How many there are, read by kernels when they run, where `cells` and `edges` are capacities; null: as many.
  const int32_t *cell_count = nullptr, *edge_count = nullptr;
  int32_t first_edge = 0, first_child = 0;  ///< what edge_begin and child_begin count too many
};

}  // namespace graupel::graph
