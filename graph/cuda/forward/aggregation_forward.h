// Forward pass, for training, of the hierarchical graph network whose receivers sum activations (Aggregation in
// graph/config/hgn_config.h), by the kernels of row_layers.h and activation_aggregation.h. Gather layers over [f_i,
// f_j, offset] are evaluated as W_i f_i + W_j f_j + W_o offset, projected once a node, kept in bf16.
#pragma once

#include <vector>

#include "graph/cuda/aggregation/activation_aggregation.h"
#include "graph/cuda/forward/packed_network.h"

namespace graupel::graph {

/// What a forward pass leaves for the backward pass.
struct AggregationRecord {
  /// A sum of activations and the network that takes it as its first operand.
  struct Step {
    uint8_t* signs = nullptr;  ///< of the activations
    FusedMlp network;
    const uint16_t* gathered = nullptr;  ///< senders' latents
  };
  FusedMlp encoder;
  RowLatents particles;                   ///< after the encoder
  std::vector<std::vector<Step>> blocks;  ///< [LayerPlan::blocks][iterations]; a prolongation has its network alone
};

/// Latents of the particles before the decoder, [particles, 128]: encoder's plus what the cells send.
RowLatents forward_aggregation(const PackedNetwork& network, const NetworkGraph& graph, RowMemory& memory,
                               AggregationRecord& record, void* stream);

}  // namespace graupel::graph
