// The decoder: a layer on tensor cores, and three outputs a frame, sums over a row's columns.
#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

namespace {

using namespace tile;

constexpr int outputs = 3;              ///< of a frame
constexpr int part_rows = outputs + 1;  ///< of partial sums: W2's gradient, then b2's

/// A warp's rows of x in its part of shared memory.
__device__ void load_rows(uint16_t* to, const Decoder& n, int64_t first, int lane) {
  if (n.x16) {
    gather_rows(to, RowOperand{n.x16}, first, n.rows, lane);
  } else {
    for (int r = 0; r < warp_rows; ++r) {
      float4 x{0, 0, 0, 0};
      if (first + r < n.rows) x = *(reinterpret_cast<const float4*>(n.x + (first + r) * layer_width) + lane);
      *reinterpret_cast<uint2*>(to + r * row_stride + 4 * lane) = {pack(x.x, x.y), pack(x.z, x.w)};
    }
  }
  __syncwarp();
}

/// Outputs `begin` to `begin` + 2 of a warp's rows, from their sums before the activation.
__device__ void decode_frame(const Decoder& n, const Sums& c, int begin, int64_t first, int lane) {
#pragma unroll
  for (int d = 0; d < outputs; ++d) {
    float sum[2] = {0, 0};
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 w = columns_of(n.w2 + (begin + d) * layer_width, j, lane);
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const float x = c[j][2 * half], y = c[j][2 * half + 1];
        sum[half] += w.x * (x > 0 ? x : n.slope * x) + w.y * (y > 0 ? y : n.slope * y);
      }
    }
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      const float total = row_sum(sum[half]) + n.b2[begin + d];
      const int64_t r = first + lane / 4 + 8 * half;
      if (lane % 4 == 0 && r < n.rows) n.out[outputs * n.frames * r + begin + d] = total;
    }
  }
}

__global__ void __launch_bounds__(threads, 2) decode_kernel(Decoder n) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 1};
  start_next();
  load_tile(shared.tile(0), n.w1);
  wait_for_previous();
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < n.rows; first += step) {
    load_rows(mine, n, first, lane);
    Sums c;
    clear(c);
    product(c, mine, shared.tile(0), lane);
    add_bias(c, n.b1, lane);
    for (int frame = 0; frame < n.frames; ++frame) decode_frame(n, c, outputs * frame, first, lane);
    __syncwarp();
  }
}

/// What a warp's rows give to the gradient of the outputs' weights; c becomes the gradient before the activation.
__device__ void outputs_backward(Sums& c, const DecoderGradient& d, int64_t first, float (&w2)[outputs][4],
                                 float (&b2)[outputs], int lane) {
  float g[2][outputs] = {};
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= d.rows) continue;
#pragma unroll
    for (int k = 0; k < outputs; ++k) g[half][k] = d.g[outputs * r + k];
  }
#pragma unroll
  for (int k = 0; k < outputs; ++k) {
    float values[2 * column_blocks];
#pragma unroll
    for (int j = 0; j < column_blocks; ++j)
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        const float low = c[j][i], high = c[j][2 + i];
        values[2 * j + i] = g[0][k] * (low > 0 ? low : slope * low) + g[1][k] * (high > 0 ? high : slope * high);
      }
    fold(values, w2[k], lane);
    b2[k] += g[0][k] + g[1][k];
  }
#pragma unroll
  for (int j = 0; j < column_blocks; ++j) {
    float2 w[outputs];
#pragma unroll
    for (int k = 0; k < outputs; ++k) w[k] = columns_of(d.w2 + k * layer_width, j, lane);
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      float sum = 0;
#pragma unroll
      for (int k = 0; k < outputs; ++k) sum += g[i / 2][k] * (i % 2 ? w[k].y : w[k].x);
      c[j][i] = sum * (c[j][i] > 0 ? 1.0f : slope);
    }
  }
}

__global__ void __launch_bounds__(threads, 1) decode_backward_kernel(DecoderGradient d) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 1};
  load_tile(shared.tile(0), d.w1);
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  float w2[outputs][4] = {}, b2[outputs] = {};
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < d.rows; first += step) {
    gather_rows(mine, RowOperand{d.x16}, first, d.rows, lane);
    __syncwarp();
    Sums c;
    clear(c);
    product(c, mine, shared.tile(0), lane);
    add_bias(c, d.b1, lane);
    outputs_backward(c, d, first, w2, b2, lane);
    __syncwarp();
    store_rows(mine, c, lane);
    __syncwarp();
    copy_out(d.d_sum, mine, first, d.rows, lane);
    clear(c);
    product_back(c, mine, shared.tile(0), lane);
    write_operand_gradient({nullptr, d.d_x}, c, first, d.rows, lane);
    __syncwarp();
  }
  // The block's sums, in the order of its warps
  __syncthreads();
  float* const sums = reinterpret_cast<float*>(shared_numbers);
  float* const own = sums + warp * part_rows * layer_width;
#pragma unroll
  for (int k = 0; k < outputs; ++k) {
#pragma unroll
    for (int i = 0; i < 4; ++i) own[k * layer_width + folded_column(i, lane)] = w2[k][i];
    float total = b2[k];  // the same in the four lanes of a row
#pragma unroll
    for (int width = 16; width >= 4; width /= 2) total += __shfl_xor_sync(0xffffffffu, total, width);
    if (lane == 0) own[outputs * layer_width + k] = total;
  }
  __syncthreads();
  for (int i = static_cast<int>(threadIdx.x); i < outputs * layer_width + outputs; i += threads) {
    float total = 0;
    for (int w = 0; w < warps; ++w) total += sums[w * part_rows * layer_width + i];
    d.partial[int64_t{blockIdx.x} * part_rows * layer_width + i] = total;
  }
}

}  // namespace

void decode(const Decoder& decoder, void* stream) {
  if (decoder.rows == 0) return;
  launch_ahead(decode_kernel, blocks_for(decoder.rows, 2), threads, shared_bytes(few_warps, 1, 1), decoder, stream);
}

int decode_backward(const DecoderGradient& gradient, void* stream) {
  if (gradient.rows == 0) return 0;
  const int blocks = blocks_for(gradient.rows, 1);
  launch(decode_backward_kernel, blocks, threads, shared_bytes(few_warps, 1, 1), gradient, stream);
  return blocks;
}

}  // namespace graupel::graph
