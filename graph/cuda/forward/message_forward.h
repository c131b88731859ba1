// Forward pass of the hierarchical graph network that sums messages (the paper's form), for rollouts, by the kernels of
// row_layers.h. Latents of an iteration take the place of older ones.
#pragma once

#include <functional>

#include "graph/cuda/forward/packed_hgn.h"

namespace graupel::graph {

/// Latents of the particles before the decoder, [particles, 128]: encoder's plus what the cells send. `grid_ready` is
/// called when the encoder has been launched, which does not need the grid.
float* forward_to_decoder(const PackedHgn& network, const HgnGraph& graph, RowMemory& memory, void* stream,
                          const std::function<void()>& grid_ready = {});

}  // namespace graupel::graph
