// Memory of one evaluation of a network that sums messages, kept between frames. Rows are padded (nn/linear.h).
#pragma once

#include <vector>

#include "graph/topology/graph_topology.h"
#include "graph/topology/tiles.h"

namespace graupel::graph {

struct Workspace {
  GraphTopology topology;
  Buffer<float> particle;            ///< [n][H] latents of particles, in sorted order
  Buffer<float> particle_part;       ///< [n][2 H] what they add to the first layers of P2G and G2P
  std::vector<Buffer<float>> cell;   ///< per level [cells][H] latents; of GNS those of particles, in sorted order
  Buffer<float> projection[2];       ///< [cells][3 H] sender, receiver and cell parts, of this and the next iteration
  Buffer<float> edge;                ///< [edges][H] edge latents of the block in progress
  Buffer<float> cell_part;           ///< [cells][H] what a cell adds to the first layer of a transfer from it
  std::vector<TileScratch> scratch;  ///< per thread

  /// Sizes what message passing needs for the topology, `width` = H and the number of features.
  void prepare(int width, int features);
};

}  // namespace graupel::graph
