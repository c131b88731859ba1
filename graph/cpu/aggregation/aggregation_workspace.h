// Memory of one evaluation of a network that sums activations, kept between frames. Rows are padded (nn/linear.h).
#pragma once

#include <utility>
#include <vector>

#include "graph/cpu/aggregation/receiver_network.h"
#include "graph/topology/graph_topology.h"
#include "graph/topology/tiles.h"
#include "nn/row_kernels.h"

namespace graupel::graph {

/// Rows that receivers gather: floats, or packed (nn/row_kernels.h) for half the memory, which is what gathering costs.
/// They are packed where the products that they come from have bf16 operands, too.
class GatheredRows {
 public:
  void resize(std::size_t rows, int width) { floats_.resize_discard(rows * static_cast<std::size_t>(width)); }
  /// Word: float, or uint32_t where they are packed.
  template <typename Word>
  Word* row(int64_t row, int width) {
    return reinterpret_cast<Word*>(floats_.data()) + row * nn::words_of<Word>(width);
  }
  template <typename Word>
  const Word* row(int64_t row, int width) const {
    return reinterpret_cast<const Word*>(floats_.data()) + row * nn::words_of<Word>(width);
  }

 private:
  Buffer<float> floats_;
};

struct AggregationWorkspace {
  GraphTopology topology;
  Buffer<float> particle;            ///< [n][H] latents of particles, in sorted order
  GatheredRows particle_part;        ///< [n][H] what particle_to_grid gathers of them
  Buffer<float> weight;              ///< [n][8] of the pairs, in sorted order
  std::vector<Buffer<float>> cell;   ///< per level [cells][H] latents
  GatheredRows current, next;        ///< [cells][up to 2 H] what is gathered of cells in this step, and in the next one
  bool on_units = false;             ///< products are made on bf16 units, and gathered rows are packed
  std::vector<TileScratch> scratch;  ///< per thread

  /// Sizes everything for the topology, `latent` = H and the number of features.
  void prepare(const sparsegrid::Hierarchy<3>& hierarchy, int latent, int features);
  /// Where the rows of `layer` of the cells from `begin` on go, for the next step.
  NextLayerRows next_rows(const nn::Linear& layer, int64_t begin) {
    if (on_units) return {.layer = layer, .packed = next.row<uint32_t>(begin, layer.width())};
    return {.layer = layer, .floats = next.row<float>(begin, layer.width())};
  }
  /// The step is done.
  void advance() { std::swap(current, next); }
};

/// body(Word()) for the rows as they are.
template <typename Body>
void with_rows(const AggregationWorkspace& workspace, const Body& body) {
  if (workspace.on_units) return body(uint32_t());
  body(float());
}

/// Rows that a thread works on at once: what lies between gathering and projecting stays in the first-level cache.
inline constexpr int32_t most_sum_rows = 32;
/// Rows of a tile of `n` receivers: small levels get small tiles, so that there is work for some threads.
constexpr int32_t sum_rows(int64_t n) {
  return static_cast<int32_t>(std::clamp<int64_t>((n / 8 + 15) / 16 * 16, 16, most_sum_rows));
}

}  // namespace graupel::graph
