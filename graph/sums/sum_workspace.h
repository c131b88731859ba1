// Memory of one evaluation of a network that sums activations, kept between frames. Rows are padded (nn/linear.h).
#pragma once

#include <utility>
#include <vector>

#include "graph/sums/sum_topology.h"
#include "graph/tiles.h"

namespace graupel::graph {

struct SumWorkspace {
  SumTopology topology;
  Buffer<float> particle;            ///< [n][H] latents of particles, in sorted order
  Buffer<float> particle_part;       ///< [n][H] what particle_to_grid gathers of them
  Buffer<float> weight;              ///< [n][8] of the pairs, in sorted order
  std::vector<Buffer<float>> cell;   ///< per level [cells][H] latents
  Buffer<float> now, next;           ///< [cells][up to 2 H] what is gathered of cells in this step, and in the next one
  std::vector<TileScratch> scratch;  ///< per thread

  /// Sizes everything for the topology, `width` = H and the number of features.
  void prepare(const sparsegrid::Hierarchy<3>& hierarchy, int width, int features);
  /// The step is done.
  void advance() { std::swap(now, next); }
};

/// Rows that a thread works on at once: inputs of 2 H columns, too, fit in TileScratch.
inline constexpr int32_t most_sum_rows = tile_rows / 2;
/// Rows of a tile of `n` receivers: small levels get small tiles, so that there is work for some threads.
constexpr int32_t sum_rows(int64_t n) {
  return static_cast<int32_t>(std::clamp<int64_t>((n / 8 + 15) / 16 * 16, 16, most_sum_rows));
}

}  // namespace graupel::graph
