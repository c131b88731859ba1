// Lanes of the kernels of activation_aggregation.cu: 16 lanes a node with eight columns each.
#pragma once

#include "graph/cuda/fused_mlp/row_block.h"

namespace graupel::graph::lanes {

constexpr int group = 16;  ///< lanes of a node
constexpr int groups = tile::threads / group;
constexpr int columns = 8;  ///< of a lane

__device__ inline void store_row(uint16_t* rows, int64_t row, const float (&x)[columns], int lane) {
  *(reinterpret_cast<uint4*>(rows + row * layer_width) + lane) = {tile::pack(x[0], x[1]), tile::pack(x[2], x[3]),
                                                                  tile::pack(x[4], x[5]), tile::pack(x[6], x[7])};
}

/// Adds the sums [parts, 128] of a block's groups, in their order, to block blockIdx.x of `partial`.
template <int parts>
__device__ void write_partial(float* partial, const float (&sums)[parts][columns]) {
  __shared__ float of_group[groups][layer_width];
  const int lane = static_cast<int>(threadIdx.x) % group;
#pragma unroll
  for (int part = 0; part < parts; ++part) {
    __syncthreads();
#pragma unroll
    for (int i = 0; i < columns; ++i) of_group[threadIdx.x / group][i * group + lane] = sums[part][i];
    __syncthreads();
    if (threadIdx.x >= layer_width) continue;
    float total = 0;
    for (const auto& one : of_group) total += one[threadIdx.x];
    const int column = columns * (static_cast<int>(threadIdx.x) % group) + static_cast<int>(threadIdx.x) / group;
    partial[(int64_t{blockIdx.x} * parts + part) * layer_width + column] = total;
  }
}

inline int blocks_of_groups(int64_t nodes, int ways) { return static_cast<int>((nodes * ways + groups - 1) / groups); }

}  // namespace graupel::graph::lanes
