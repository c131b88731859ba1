// Products of rows with a matrix or two, and sums of rows.
#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

namespace {

using namespace tile;

/// Weights of the offsets, in shared memory.
using OffsetWeights = float[3][layer_width];

__device__ void load_offset_weights(OffsetWeights& to, const float* from, int stride) {
  for (int i = static_cast<int>(threadIdx.x); i < 3 * layer_width; i += threads)
    to[i % 3][i / 3] = from[int64_t{i / 3} * stride + i % 3];
}

__device__ void add_offsets(Sums& c, const OffsetWeights& weights, const float* offsets, float sign, int64_t rows,
                            int64_t first, int lane) {
  float offset[2][3] = {};
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
#pragma unroll
    for (int d = 0; d < 3; ++d) offset[half][d] = sign * offsets[3 * r + d];
  }
#pragma unroll
  for (int block = 0; block < column_blocks; ++block)
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      const float2 w = columns_of(weights[d], block, lane);
      c[block][0] += w.x * offset[0][d], c[block][1] += w.y * offset[0][d];
      c[block][2] += w.x * offset[1][d], c[block][3] += w.y * offset[1][d];
    }
}

__global__ void __launch_bounds__(threads, 2) project_kernel(RowProjection p) {
  constexpr int warps = few_warps;
  start_next();
  const Shared<warps> shared{shared_numbers, 2};
  __shared__ OffsetWeights offset_weights[2];
  for (int j = 0; j < 2; ++j) {
    if (!p.to.weight[j]) continue;
    load_tile(shared.tile(j), p.to.weight[j]);
    if (p.offset) load_offset_weights(offset_weights[j], p.offset_weight[j], p.offset_stride[j]);
  }
  wait_for_previous();
  const int64_t rows = rows_now(p.rows, p.row_count);
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const RowOperand x{p.x};
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < rows; first += step) {
    gather_rows(mine, x, first, rows, lane);
    __syncwarp();
#pragma unroll
    for (int j = 0; j < 2; ++j) {
      if (!p.to.weight[j]) continue;
      Sums c;
      clear(c);
      product(c, mine, shared.tile(j), lane);
      if (p.to.bias[j]) add_bias(c, p.to.bias[j], lane);
      if (p.offset) add_offsets(c, offset_weights[j], p.offset, p.offset_sign[j], rows, first, lane);
      write_operand_gradient({nullptr, p.to.out[j], nullptr, p.to.out16[j]}, c, first, rows, lane);
    }
    __syncwarp();
  }
}

__global__ void __launch_bounds__(threads, 2) project_back_kernel(ProjectionGradient p) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 2};
  for (int j = 0; j < 2; ++j)
    if (p.d[j].weight) load_tile(shared.tile(j), p.d[j].weight);
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < p.rows; first += step) {
    Sums c;
    clear(c);
#pragma unroll
    for (int j = 0; j < 2; ++j) {
      if (!p.d[j].weight) continue;
      gather_rows(mine, p.d[j], first, p.rows, lane);
      __syncwarp();
      product_back(c, mine, shared.tile(j), lane);
      __syncwarp();
    }
    write_operand_gradient({p.add32, p.sum32}, c, first, p.rows, lane);
  }
}

/// `ways` half warps a segment, each with every ways-th eight of its rows; a lane has eight columns.
template <int ways>
__global__ void __launch_bounds__(threads) sum_segments_kernel(SegmentRows s) {
  start_next();
  wait_for_previous();
  constexpr int a_block = threads / (16 * ways), under_way = 8;
  const int lane = static_cast<int>(threadIdx.x) % 16, way = static_cast<int>(threadIdx.x) / 16 % ways;
  const int64_t segment = int64_t{blockIdx.x} * a_block + threadIdx.x / (16 * ways);
  const bool there = segment < rows_now(s.segments, s.row_count);
  if (ways == 1 && !there) return;
  float sum[8] = {};
  if (there) {
    const int64_t begin = s.begin[segment] - s.first, end = s.begin[segment + 1] - s.first;
    for (int64_t at = begin + way * under_way; at < end; at += ways * under_way) {
      uint4 word[under_way];
      float weight[under_way];
#pragma unroll
      for (int k = 0; k < under_way; ++k) {
        word[k] = {0, 0, 0, 0};
        weight[k] = 0;
        if (at + k >= end) continue;
        const int64_t row = s.item ? s.item[at + k] : at + k;
        weight[k] = s.weight ? s.weight[row] : 1.0f;
        word[k] = *(reinterpret_cast<const uint4*>(s.source + row * layer_width) + lane);
      }
#pragma unroll
      for (int k = 0; k < under_way; ++k) add_numbers(sum, word[k], weight[k]);
    }
  }
  if constexpr (ways > 1) {
    __shared__ float parts[threads * 8];
#pragma unroll
    for (int i = 0; i < 8; ++i) parts[threadIdx.x * 8 + i] = sum[i];
    __syncthreads();
    if (way > 0 || !there) return;
#pragma unroll
    for (int other = 1; other < ways; ++other)
#pragma unroll
      for (int i = 0; i < 8; ++i) sum[i] += parts[(threadIdx.x + 16 * other) * 8 + i];
  }
  const int64_t place = segment * layer_width + 8 * lane;
#pragma unroll
  for (int i = 0; i < 8; ++i) sum[i] *= s.scale;
  if (s.out32)
#pragma unroll
    for (int i = 0; i < 2; ++i)
      *reinterpret_cast<float4*>(s.out32 + place + 4 * i) = {sum[4 * i], sum[4 * i + 1], sum[4 * i + 2],
                                                             sum[4 * i + 3]};
  if (s.out16)
    *reinterpret_cast<uint4*>(s.out16 + place) = {pack(sum[0], sum[1]), pack(sum[2], sum[3]), pack(sum[4], sum[5]),
                                                  pack(sum[6], sum[7])};
}

template <int ways>
void launch_sums(const SegmentRows& segments, void* stream) {
  constexpr int a_block = threads / (16 * ways);
  launch_ahead(sum_segments_kernel<ways>, static_cast<int>((segments.segments + a_block - 1) / a_block), threads, 0,
               segments, stream);
}

}  // namespace

void project(const RowProjection& projection, void* stream) {
  if (projection.rows == 0) return;
  launch_ahead(project_kernel, blocks_for(projection.rows, 2), threads, shared_bytes(few_warps, 2, 1), projection,
               stream);
}

void project_back(const ProjectionGradient& gradient, void* stream) {
  if (gradient.rows == 0) return;
  launch(project_back_kernel, blocks_for(gradient.rows, 2), threads, shared_bytes(few_warps, 2, 1), gradient, stream);
}

void sum_segments(const SegmentRows& segments, void* stream) {
  if (segments.segments == 0) return;
  segments.are_long ? launch_sums<8>(segments, stream) : launch_sums<1>(segments, stream);
}

}  // namespace graupel::graph
