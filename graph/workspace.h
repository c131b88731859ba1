// Memory of one evaluation of the network, kept between frames. Rows are padded (nn/linear.h).
#pragma once

#include <omp.h>

#include <vector>

#include "core/buffer.h"
#include "core/parallel_for.h"
#include "graph/graph_topology.h"

namespace graupel::graph {

/// What one thread needs for one tile; each [tile_rows][H], `input` wide enough for features, too.
struct TileScratch {
  Buffer<float> input, hidden, output, sums;
};

struct Workspace {
  GraphTopology topology;
  Buffer<float> particle;            ///< [n][H] latents of particles, in sorted order
  Buffer<float> particle_part;       ///< [n][2 H] what they add to the first layers of P2G and G2P
  std::vector<Buffer<float>> cell;   ///< per level [cells][H] latents
  Buffer<float> projection[2];       ///< [cells][3 H] sender, receiver and cell parts, of this and the next iteration
  Buffer<float> edge;                ///< [edges][H] edge latents of the block in progress
  Buffer<float> cell_part;           ///< [cells][H] what a cell adds to the first layer of a transfer from it
  std::vector<TileScratch> scratch;  ///< per thread

  /// Sizes everything for the topology, `width` = H and the number of features.
  void prepare(int width, int features);
};

/// body(begin, end, scratch) for each of the tiles, in parallel; tiles are independent.
template <typename Body>
void for_each_tile(Workspace& workspace, const std::vector<int32_t>& tile, const Body& body) {
  parallel_for(
      Device::cpu, static_cast<int64_t>(tile.size()) - 1,
      [&](int64_t t) {
        body(tile[static_cast<std::size_t>(t)], tile[static_cast<std::size_t>(t) + 1],
             workspace.scratch[static_cast<std::size_t>(omp_get_thread_num())]);
      },
      Grain{1});
}

/// The same for ranges of `rows` items out of [0, n).
template <typename Body>
void for_each_range(Workspace& workspace, int64_t n, int64_t rows, const Body& body) {
  parallel_for(
      Device::cpu, (n + rows - 1) / rows,
      [&](int64_t t) {
        body(static_cast<int32_t>(t * rows), static_cast<int32_t>(t * rows + rows < n ? t * rows + rows : n),
             workspace.scratch[static_cast<std::size_t>(omp_get_thread_num())]);
      },
      Grain{1});
}

}  // namespace graupel::graph
