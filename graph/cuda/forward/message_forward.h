// Forward pass of the graph networks that sum messages, by the kernels of row_layers.h: HGN in the paper's form, for
// rollouts, and GNS, for rollouts and training. Edge latents and messages are bf16, the latents of nodes f32.
#pragma once

#include <functional>
#include <vector>

#include "graph/cuda/forward/packed_network.h"

namespace graupel::graph {

/// Where the latents of the edges lie, [edges, 128] each.
class EdgeMemory {
 public:
  virtual ~EdgeMemory() = default;
  /// e before iteration k. An iteration's may be that of the one before: it is written where it was read.
  virtual uint16_t* latent(int64_t k) = 0;
  /// The messages of an iteration.
  virtual uint16_t* message() = 0;
};

/// What a forward pass leaves for the backward pass.
struct MessageRecord {
  struct Step {
    FusedMlp edge;  ///< operand 0: e
    FusedMlp node;  ///< operands: the sums of messages, f
  };
  FusedMlp node_encoder, edge_encoder;
  std::vector<Step> step;  ///< of all iterations
};

/// Latents of the particles before the decoder, [particles, 128]. `graph_ready` is called when the encoder has been
/// launched, which needs no links. Without `edges` the edges' latents are kept with the rows of their block.
float* forward_messages(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory, EdgeMemory* edges,
                        MessageRecord& record, void* stream, const std::function<void()>& graph_ready = {});

}  // namespace graupel::graph
