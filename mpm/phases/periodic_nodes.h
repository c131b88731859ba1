// Which nodes are one and the same behind periodic walls. Particles within a cell of a wall reach nodes beyond it, so
// that three layers of nodes at each end of a periodic axis have an image at the other end, for both splines (a cubic
// stencil's fourth node beyond an end has weight zero there).
#pragma once

#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// Whether a node has an image along an axis; it is then replaced by that at the lower end.
GRAUPEL_HD inline bool image_at_low_end(const PeriodicAxis& axis, int& node) {
  if (axis.cells == 0) return false;
  const int from_low = node - axis.low_node, from_high = from_low - axis.cells;
  if (from_high >= -1 && from_high <= 1) node -= axis.cells;
  return (from_low >= -1 && from_low <= 1) || (from_high >= -1 && from_high <= 1);
}

/// Calls visit(entry) for all images in use of node `inside` of the block with this key, itself among them, in an order
/// that is the same for each of them. An entry is a number of a node in view.nodes.
template <int D, typename T, typename Visit>
GRAUPEL_HD inline void for_images(const SolverView<T>& view, int32_t key, int inside, const Visit& visit) {
  const Vec<int, D> own_block = in_axes<D>(view.grid).block_of(key);
  Vec<int, D> low = node_in_block<D>(inside);
  int images[3] = {1, 1, 1};
  for (int d = 0; d < D; ++d) {
    low[d] += block_width * own_block[d];
    images[d] = image_at_low_end(view.walls.periodic[d], low[d]) ? 2 : 1;
  }
  for (int x = 0; x < images[0]; ++x)
    for (int y = 0; y < images[1]; ++y)
      for (int z = 0; z < images[2]; ++z) {
        const Vec<int, D> image = in_axes<D>(Vec<int, 3>{x, y, z});
        Vec<int, D> block;
        int place = 0;
        for (int d = 0; d < D; ++d) {
          const int node = low[d] + image[d] * view.walls.periodic[d].cells;
          block[d] = node / block_width;
          place = place * block_width + node % block_width;
        }
        const int32_t number = view.blocks.node_of_key[in_axes<D>(view.grid).directory_index(block)];
        if (number >= 0) visit(int64_t(number) * nodes_per_block<D> + place);
      }
}

}  // namespace graupel::mpm
