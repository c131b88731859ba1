// What a block of persistent_layers.cu keeps of a tile of rows, and what it does with the tile's products.
#pragma once

#include "graph/cuda/persistent/persistent_gather.h"
#include "graph/cuda/persistent/persistent_product.h"

namespace graupel::graph::wide {

/// Networks of which a block knows: the one that it works on and the next two, in a ring.
constexpr int descriptions = 4;

/// What a block keeps in shared memory.
struct TileMemory {
  __align__(16) uint16_t operand[2][tile_rows * row_stride];
  __align__(16) uint16_t hidden[tile_rows * row_stride];
  __align__(16) float vectors[2][vectors_of_network][layer_width];
  __align__(16) PersistentLayer network[descriptions];  ///< of the network that is worked on and of those after it
  __align__(16) Table table[2];
  StagedLinks links[2];  ///< of the tile that is worked on, and of the next one
  float2 statistics[warps][tile_rows];
  float decoded[warps][tile_rows][3];
  float offset[tile_rows][3];  ///< positions of the tile's rows in their cells
  int32_t rows[most_networks], tiles[most_networks], first_link[most_networks];
};

__device__ inline float4 vector_of(const float (&vectors)[vectors_of_network][layer_width], int which,
                                   const Place& at) {
  return *reinterpret_cast<const float4*>(&vectors[which][at.column]);
}

__device__ inline void store(uint16_t* rows, Part& c, const Place& at) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float4 v = c.row(half);
    *reinterpret_cast<uint2*>(rows + (at.group + 8 * half) * row_stride + at.column) = {pack(v.x, v.y), pack(v.z, v.w)};
  }
}

/// Means and squares of deviations of a warp's 16 columns, row by row.
__device__ inline void leave_statistics(TileMemory& s, Part& c, const Place& at) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const float4 v = c.row(half);
    const float mean = row_sum(v.x + v.y + v.z + v.w) * (1.0f / 16);
    const float x = v.x - mean, y = v.y - mean, z = v.z - mean, w = v.w - mean;
    const float squares = row_sum(x * x + y * y + z * z + w * w);
    if (at.lane % 4 == 0) s.statistics[at.warp][at.group + 8 * half] = {mean, squares};
  }
}

/// Layer norm from the statistics of all warps (Chan et al. 1983, equation 2.1).
__device__ inline void normalize(const TileMemory& s, int pipeline_index, Part& c, const Place& at) {
  const float4 scale = vector_of(s.vectors[pipeline_index % 2], norm_scale, at),
               shift = vector_of(s.vectors[pipeline_index % 2], norm_shift, at);
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int row = at.group + 8 * half;
    float2 part[warps];
    float mean = 0, squares = 0;
#pragma unroll
    for (int w = 0; w < warps; ++w) {
      part[w] = s.statistics[w][row];
      mean += part[w].x;
    }
    mean *= 1.0f / warps;
#pragma unroll
    for (int w = 0; w < warps; ++w) squares += part[w].y + 16 * (part[w].x - mean) * (part[w].x - mean);
    const float inverse = rsqrtf(squares * (1.0f / layer_width) + 1e-5f);
    c.value(half, 0) = (c.value(half, 0) - mean) * inverse * scale.x + shift.x;
    c.value(half, 1) = (c.value(half, 1) - mean) * inverse * scale.y + shift.y;
    c.value(half, 2) = (c.value(half, 2) - mean) * inverse * scale.z + shift.z;
    c.value(half, 3) = (c.value(half, 3) - mean) * inverse * scale.w + shift.w;
  }
}

/// Coordinate d of a row's position in its cell.
__device__ inline float cell_offset(const CellOffset& offset, int64_t row, int d) {
  const double u =
      (static_cast<double>(__ldg(offset.position + 3 * row + d)) - offset.origin[d]) * offset.inverse_spacing - 0.5;
  return static_cast<float>(u - floor(u));
}
/// What a row's position in its cell adds to an epilogue.
__device__ inline void add_offset(Part& c, int half, const CellOffset& offset, int out, const float (&position)[3],
                                  const Place& at) {
#pragma unroll
  for (int d = 0; d < 3; ++d) {
    const float part = position[d];
    const float4 w = __ldg(reinterpret_cast<const float4*>(offset.weight + (3 * out + d) * layer_width + at.column));
    c.add(half, {part * w.x, part * w.y, part * w.z, part * w.w});
  }
}

/// The decoder's second layer: a warp's columns' parts of its sums.
__device__ inline void leave_decoded(TileMemory& s, int pipeline_index, Part& c, const Place& at) {
#pragma unroll
  for (int d = 0; d < 3; ++d) {
    const float4 w = vector_of(s.vectors[pipeline_index % 2], out_bias1 + d, at);
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const float4 v = c.row(half);
      const float sum = row_sum(v.x * w.x + v.y * w.y + v.z * w.z + v.w * w.w);
      if (at.lane % 4 == 0) s.decoded[at.warp][at.group + 8 * half][d] = sum;
    }
  }
}

}  // namespace graupel::graph::wide
