#include "graph/cuda/row_layers.h"

#include <algorithm>

#include "core/cuda_check.h"
#include "core/error.h"
#include "graph/cuda/tile_product.h"

namespace graupel::graph {

namespace {

using namespace tile;

constexpr int threads = 256;
/// Warps of a block: as many as registers and shared memory allow, for their loads to overlap.
constexpr int few_warps = 8, many_warps = 12;
constexpr float slope = 0.01f;
constexpr int types = 9;  ///< rows of the embedding table (graph/features.h)

int multiprocessors() {
  static const int count = [] {
    int device = 0, value = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&value, cudaDevAttrMultiProcessorCount, device));
    return value;
  }();
  return count;
}

/// First row of a warp: neighbouring rows go to different blocks, so that few rows keep many multiprocessors busy.
__device__ int64_t first_row(int warp) { return (int64_t{warp} * gridDim.x + blockIdx.x) * warp_rows; }

/// Blocks for `rows` rows when `resident` of them run on a multiprocessor at a time.
int blocks_for(int64_t rows, int resident) {
  const int64_t wanted = (rows + warp_rows - 1) / warp_rows;
  return static_cast<int>(std::clamp<int64_t>(wanted, 1, int64_t{resident} * multiprocessors()));
}

/// The shared memory of a block: tiles, then `parts` times 16 rows a warp.
template <int warps>
struct Shared {
  uint16_t* numbers;
  int tiles;
  __device__ uint16_t* tile(int i) const { return numbers + i * (tile_bytes / 2); }
  __device__ uint16_t* rows(int part, int warp) const {
    return numbers + tiles * (tile_bytes / 2) + (part * warps + warp) * (warp_bytes / 2);
  }
};
constexpr int shared_bytes(int warps, int tiles, int parts) { return tiles * tile_bytes + parts * warps * warp_bytes; }

extern __shared__ __align__(16) uint16_t shared_numbers[];

/// First-layer sums of a warp's rows; with `keep`, operands are saved where the network asks for it.
template <int operands, int warps>
__device__ void first_layer(Sums& c, const RowNetwork& n, const Shared<warps>& shared, uint16_t* mine, int64_t first,
                            int lane) {
  clear(c);
#pragma unroll
  for (int j = 0; j < operands; ++j) {
    gather_rows(mine, n.operand[j], first, n.rows, lane);
    __syncwarp();
    product(c, mine, shared.tile(1 + j), lane);
    if (n.operand[j].save) copy_out(n.operand[j].save, mine, first, n.rows, lane);
    __syncwarp();
  }
#pragma unroll
  for (int t = 0; t < 3; ++t)
    if (n.table[t].table) add_table(c, n.table[t].table, n.table[t].row, first, n.rows, lane);
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 4; ++i) c[j][i] = c[j][i] > 0 ? c[j][i] : slope * c[j][i];
}

template <int operands, int warps>
__device__ void load_weights(const RowNetwork& n, const Shared<warps>& shared) {
  load_tile(shared.tile(0), n.w2);
#pragma unroll
  for (int j = 0; j < operands; ++j) load_tile(shared.tile(1 + j), n.operand[j].weight);
  __syncthreads();
}

/// What follows the layer norm: residual sums in f32 and bf16.
__device__ void write_sums(const RowNetwork& n, const Sums& c, int64_t first, int lane) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= n.rows) continue;
    const int64_t at = r * layer_width + 2 * (lane % 4);
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float x = c[j][2 * half], y = c[j][2 * half + 1];
      if (n.sum16) {
        const float2 before = unpack(*reinterpret_cast<const uint32_t*>(n.add16 + at + 8 * j));
        *reinterpret_cast<uint32_t*>(n.sum16 + at + 8 * j) = pack(before.x + x, before.y + y);
      }
      if (n.sum32) {
        float2 sum{x, y};
        if (n.add32) {
          const float2 before = *reinterpret_cast<const float2*>(n.add32 + at + 8 * j);
          sum.x += before.x, sum.y += before.y;
        }
        *reinterpret_cast<float2*>(n.sum32 + at + 8 * j) = sum;
        if (n.copy16) *reinterpret_cast<uint32_t*>(n.copy16 + at + 8 * j) = pack(sum.x, sum.y);
      }
    }
  }
}

template <int operands, int warps>
__global__ void __launch_bounds__(32 * warps, operands == 2 ? 1 : 2) forward_kernel(RowNetwork n) {
  const Shared<warps> shared{shared_numbers, 1 + operands};
  load_weights<operands>(n, shared);
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < n.rows; first += step) {
    Sums c;
    first_layer<operands>(c, n, shared, mine, first, lane);
    store_rows(mine, c, lane);
    __syncwarp();
    clear(c);
    product(c, mine, shared.tile(0), lane);
    add_bias(c, n.b2, lane);
    float inverse[2];
    normalize(c, inverse);
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 gamma = columns_of(n.gamma, j, lane), beta = columns_of(n.beta, j, lane);
      c[j][0] = c[j][0] * gamma.x + beta.x, c[j][1] = c[j][1] * gamma.y + beta.y;
      c[j][2] = c[j][2] * gamma.x + beta.x, c[j][3] = c[j][3] * gamma.y + beta.y;
    }
    __syncwarp();
    if (n.out16) {
      store_rows(mine, c, lane);
      __syncwarp();
      copy_out(n.out16, mine, first, n.rows, lane);
      __syncwarp();
    }
    write_sums(n, c, first, lane);
  }
}

/// Adds `values` of the lanes with equal lane % 4 and leaves four of the sums with each lane: those from
/// 16 [lane bit 4] + 8 [bit 3] + 4 [bit 2] on.
__device__ void fold(float (&values)[2 * column_blocks], float (&sums)[4], int lane) {
#pragma unroll
  for (int width = column_blocks; width >= 4; width /= 2) {
    const bool upper = (lane & width) != 0;
#pragma unroll
    for (int i = 0; i < width; ++i) {
      const float send = upper ? values[i] : values[i + width], keep = upper ? values[i + width] : values[i];
      values[i] = keep + __shfl_xor_sync(0xffffffffu, send, width);
    }
  }
#pragma unroll
  for (int i = 0; i < 4; ++i) sums[i] += values[i];
}

/// Gradient of a warp's rows' results.
__device__ void result_gradient(Sums& g, const RowNetworkGradient& d, int64_t first, int lane) {
  clear(g);
  const int64_t rows = d.network.rows;
  if (d.g32) add_table(g, d.g32, d.g_row, first, rows, lane, d.g_weight, d.g_scale);
  if (d.g16 == nullptr) return;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
    const uint32_t* const from = reinterpret_cast<const uint32_t*>(d.g16 + r * layer_width) + lane % 4;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 v = unpack(from[4 * j]);
      g[j][2 * half] += v.x;
      g[j][2 * half + 1] += v.y;
    }
  }
}

/// c (normalised rows) becomes the gradient before the layer norm (Ba et al. 2016); adds to gamma's and beta's.
__device__ void norm_backward(Sums& c, Sums& g, const float (&inverse)[2], const float* gamma, float (&gamma_sums)[4],
                              float (&beta_sums)[4], int lane) {
  float values[2 * column_blocks];
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 2; ++i) values[2 * j + i] = g[j][i] + g[j][2 + i];
  fold(values, beta_sums, lane);
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 2; ++i) values[2 * j + i] = g[j][i] * c[j][i] + g[j][2 + i] * c[j][2 + i];
  fold(values, gamma_sums, lane);
  float mean[2] = {0, 0}, slope_sum[2] = {0, 0};
#pragma unroll
  for (int j = 0; j < column_blocks; ++j) {
    const float2 factor = columns_of(gamma, j, lane);
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      g[j][i] *= i % 2 ? factor.y : factor.x;
      mean[i / 2] += g[j][i];
      slope_sum[i / 2] += g[j][i] * c[j][i];
    }
  }
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    mean[half] = row_sum(mean[half]) * (1.0f / layer_width);
    slope_sum[half] = row_sum(slope_sum[half]) * (1.0f / layer_width);
  }
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 4; ++i) c[j][i] = inverse[i / 2] * (g[j][i] - mean[i / 2] - c[j][i] * slope_sum[i / 2]);
}

__device__ void write_operand_gradient(const OperandGradient& d, const Sums& c, int64_t first, int64_t rows, int lane) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
    const int64_t at = r * layer_width + 2 * (lane % 4);
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      float2 sum{c[j][2 * half], c[j][2 * half + 1]};
      if (d.add32) {
        const float2 before = *reinterpret_cast<const float2*>(d.add32 + at + 8 * j);
        sum.x += before.x, sum.y += before.y;
      }
      if (d.add16) {
        const float2 before = unpack(*reinterpret_cast<const uint32_t*>(d.add16 + at + 8 * j));
        sum.x += before.x, sum.y += before.y;
      }
      if (d.d32) *reinterpret_cast<float2*>(d.d32 + at + 8 * j) = sum;
      if (d.d16) *reinterpret_cast<uint32_t*>(d.d16 + at + 8 * j) = pack(sum.x, sum.y);
    }
  }
}

template <int operands, int warps>
__global__ void __launch_bounds__(32 * warps, 1) backward_kernel(RowNetworkGradient d) {
  const RowNetwork& n = d.network;
  const Shared<warps> shared{shared_numbers, 1 + operands};
  load_weights<operands>(n, shared);
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t *const hidden = shared.rows(0, warp), *const raw = shared.rows(1, warp);
  float gamma_sums[4] = {0, 0, 0, 0}, beta_sums[4] = {0, 0, 0, 0};
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < n.rows; first += step) {
    Sums c;
    first_layer<operands>(c, n, shared, hidden, first, lane);
    store_rows(hidden, c, lane);
    __syncwarp();
    copy_out(d.hidden, hidden, first, n.rows, lane);
    clear(c);
    product(c, hidden, shared.tile(0), lane);
    add_bias(c, n.b2, lane);
    float inverse[2];
    normalize(c, inverse);
    Sums g;
    result_gradient(g, d, first, lane);
    norm_backward(c, g, inverse, n.gamma, gamma_sums, beta_sums, lane);
    store_rows(raw, c, lane);
    __syncwarp();
    copy_out(d.d_raw, raw, first, n.rows, lane);
    clear(c);
    product_back(c, raw, shared.tile(0), lane);
    __syncwarp();
    // Back through the activation: its slope is that of the sign, which it keeps.
    const uint32_t* const low = reinterpret_cast<const uint32_t*>(hidden + (lane / 4) * row_stride) + lane % 4;
    const uint32_t* const high = low + 8 * row_stride / 2;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 a = unpack(low[4 * j]), b = unpack(high[4 * j]);
      c[j][0] *= a.x > 0 ? 1.0f : slope, c[j][1] *= a.y > 0 ? 1.0f : slope;
      c[j][2] *= b.x > 0 ? 1.0f : slope, c[j][3] *= b.y > 0 ? 1.0f : slope;
    }
    store_rows(hidden, c, lane);  // each lane where it has just read
    __syncwarp();
    copy_out(d.d_sum, hidden, first, n.rows, lane);
#pragma unroll
    for (int j = 0; j < operands; ++j) {
      clear(c);
      product_back(c, hidden, shared.tile(1 + j), lane);
      write_operand_gradient(d.operand[j], c, first, n.rows, lane);
    }
    __syncwarp();
  }
  // The block's sums, in the order of its warps
  __syncthreads();
  float* const sums = reinterpret_cast<float*>(shared_numbers);
  const int base = (lane & 16 ? 16 : 0) + (lane & 8 ? 8 : 0) + (lane & 4 ? 4 : 0);
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    const int column = 8 * ((base + i) / 2) + 2 * (lane % 4) + i % 2;
    sums[warp * 2 * layer_width + column] = gamma_sums[i];
    sums[warp * 2 * layer_width + layer_width + column] = beta_sums[i];
  }
  __syncthreads();
  if (threadIdx.x >= 2 * layer_width) return;
  float total = 0;
  for (int w = 0; w < warps; ++w) total += sums[w * 2 * layer_width + static_cast<int>(threadIdx.x)];
  d.norm_partial[int64_t{blockIdx.x} * 2 * layer_width + threadIdx.x] = total;
}

__device__ void add_offsets(Sums& c, const RowProjection& p, int j, int64_t first, int lane) {
  float offset[2][3] = {};
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= p.rows) continue;
#pragma unroll
    for (int d = 0; d < 3; ++d) offset[half][d] = p.offset_sign[j] * p.offset[3 * r + d];
  }
#pragma unroll
  for (int block = 0; block < column_blocks; ++block)
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      const float* const row = p.offset_weight[j] + int64_t{8 * block + 2 * (lane % 4) + i} * p.offset_stride[j];
#pragma unroll
      for (int d = 0; d < 3; ++d) {
        const float w = row[d];
        c[block][i] += w * offset[0][d];
        c[block][2 + i] += w * offset[1][d];
      }
    }
}

__global__ void __launch_bounds__(threads, 2) project_kernel(RowProjection p) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 2};
  for (int j = 0; j < 2; ++j)
    if (p.weight[j]) load_tile(shared.tile(j), p.weight[j]);
  __syncthreads();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const RowOperand x{p.x};
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < p.rows; first += step) {
    gather_rows(mine, x, first, p.rows, lane);
    __syncwarp();
#pragma unroll
    for (int j = 0; j < 2; ++j) {
      if (!p.weight[j]) continue;
      Sums c;
      clear(c);
      product(c, mine, shared.tile(j), lane);
      if (p.bias[j]) add_bias(c, p.bias[j], lane);
      if (p.offset) add_offsets(c, p, j, first, lane);
      write_operand_gradient({nullptr, p.out[j]}, c, first, p.rows, lane);
    }
    __syncwarp();
  }
}

__global__ void __launch_bounds__(threads, 2) project_back_kernel(ProjectionGradient p) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 2};
  for (int j = 0; j < 2; ++j)
    if (p.d[j].weight) load_tile(shared.tile(j), p.d[j].weight);
  __syncthreads();
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
      if (p.d[j].save) copy_out(p.d[j].save, mine, first, p.rows, lane);
      product_back(c, mine, shared.tile(j), lane);
      __syncwarp();
    }
    write_operand_gradient({p.add32, p.sum32}, c, first, p.rows, lane);
  }
}

/// Half a warp a segment; a lane has eight columns.
__global__ void __launch_bounds__(threads) sum_segments_kernel(SegmentRows s) {
  const int64_t segment = int64_t{blockIdx.x} * (threads / 16) + threadIdx.x / 16;
  const int lane = static_cast<int>(threadIdx.x) % 16;
  if (segment >= s.segments) return;
  const int64_t begin = s.begin ? s.begin[segment] - s.first : segment * s.fixed;
  const int64_t end = s.begin ? s.begin[segment + 1] - s.first : begin + s.fixed;
  float sum[8] = {};
  constexpr int under_way = 8;
  for (int64_t at = begin; at < end; at += under_way) {
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
  const int64_t place = segment * layer_width + 8 * lane;
#pragma unroll
  for (int i = 0; i < 8; ++i) sum[i] *= s.scale;
  if (s.add32)
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      const float4 before = *reinterpret_cast<const float4*>(s.add32 + place + 4 * i);
      sum[4 * i] += before.x, sum[4 * i + 1] += before.y, sum[4 * i + 2] += before.z, sum[4 * i + 3] += before.w;
    }
  if (s.out32)
#pragma unroll
    for (int i = 0; i < 2; ++i)
      *reinterpret_cast<float4*>(s.out32 + place + 4 * i) = {sum[4 * i], sum[4 * i + 1], sum[4 * i + 2],
                                                             sum[4 * i + 3]};
  if (s.out16)
    *reinterpret_cast<uint4*>(s.out16 + place) = {pack(sum[0], sum[1]), pack(sum[2], sum[3]), pack(sum[4], sum[5]),
                                                  pack(sum[6], sum[7])};
}

__global__ void __launch_bounds__(threads) pack_tiles_kernel(const TileSource* sources, uint16_t* tiles) {
  const TileSource source = sources[blockIdx.x];
  uint32_t* const to = reinterpret_cast<uint32_t*>(tiles + int64_t{blockIdx.x} * tile_numbers);
  for (int i = static_cast<int>(threadIdx.x); i < tile_numbers / 2; i += threads) {
    const int row = i / (layer_width / 2), column = 2 * (i % (layer_width / 2));
    const float* const from = source.source + int64_t{row} * source.stride + column;
    to[i] = pack(column < source.columns ? from[0] : 0, column + 1 < source.columns ? from[1] : 0);
  }
}

/// Offset d of row t.
__device__ float offset_of(Offsets offsets, int t, int d) {
  const float bit = static_cast<float>(t >> d & 1);
  switch (offsets) {
    case Offsets::corner:
      return bit;
    case Offsets::octant:
      return 0.5f - bit;
    default:  // a sender at -x (slot 0) sees its receiver at +x
      return t / 2 != d ? 0.0f : t % 2 == 0 ? 1.0f : -1.0f;
  }
}

__global__ void __launch_bounds__(layer_width) make_tables_kernel(const OffsetTable* tables, float* out) {
  const OffsetTable table = tables[blockIdx.x];
  const int t = static_cast<int>(blockIdx.y), column = static_cast<int>(threadIdx.x);
  const bool is_embedding = table.offsets == Offsets::embedding;
  if (is_embedding ? t >= types : t >= 8) return;
  float sum = 0;
  for (int d = 0; d < (is_embedding ? table.width : 3); ++d)
    sum += (is_embedding ? table.embedding[t * table.width + d] : offset_of(table.offsets, t, d)) *
           table.w[int64_t{column} * table.stride + d];
  out[(int64_t{blockIdx.x} * most_table_rows + t) * layer_width + column] =
      table.sign * sum + (table.bias ? table.bias[column] : 0);
}

/// A thread a column, some rows a block: the matrix is read once a block.
constexpr int feature_rows = 32;
__global__ void __launch_bounds__(layer_width) encode_kernel(FeatureLayer layer) {
  __shared__ float features[feature_rows * layer_width];
  const int column = static_cast<int>(threadIdx.x);
  const int64_t first = int64_t{blockIdx.x} * feature_rows;
  const int rows = static_cast<int>(layer.rows - first < feature_rows ? layer.rows - first : feature_rows);
  for (int i = column; i < feature_rows * layer.width; i += layer_width)
    features[i] = i < rows * layer.width ? layer.features[first * layer.width + i] : 0;
  __syncthreads();
  float sums[feature_rows] = {};
  const float* const weights = layer.w1 + int64_t{column} * layer.stride;
  for (int k = 0; k < layer.width; ++k) {
    const float w = weights[k];
#pragma unroll
    for (int r = 0; r < feature_rows; ++r) sums[r] += w * features[r * layer.width + k];
  }
#pragma unroll
  for (int r = 0; r < feature_rows; ++r)
    if (r < rows)
      layer.out[(first + r) * layer_width + column] =
          sums[r] + layer.type_table[int64_t{layer.type_row[first + r]} * layer_width + column];
}

__global__ void __launch_bounds__(threads, 2) decode_kernel(Decoder n) {
  constexpr int warps = few_warps;
  const Shared<warps> shared{shared_numbers, 1};
  load_tile(shared.tile(0), n.w1);
  __syncthreads();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < n.rows; first += step) {
    for (int r = 0; r < warp_rows; ++r) {
      float4 x{0, 0, 0, 0};
      if (first + r < n.rows) x = *(reinterpret_cast<const float4*>(n.x + (first + r) * layer_width) + lane);
      *reinterpret_cast<uint2*>(mine + r * row_stride + 4 * lane) = {pack(x.x, x.y), pack(x.z, x.w)};
    }
    __syncwarp();
    Sums c;
    clear(c);
    product(c, mine, shared.tile(0), lane);
    add_bias(c, n.b1, lane);
#pragma unroll
    for (int d = 0; d < 3; ++d) {
      float sum[2] = {0, 0};
#pragma unroll
      for (int j = 0; j < column_blocks; ++j) {
        const float2 w = columns_of(n.w2 + d * layer_width, j, lane);
#pragma unroll
        for (int half = 0; half < 2; ++half) {
          const float x = c[j][2 * half], y = c[j][2 * half + 1];
          sum[half] += w.x * (x > 0 ? x : slope * x) + w.y * (y > 0 ? y : slope * y);
        }
      }
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const float total = row_sum(sum[half]) + n.b2[d];
        const int64_t r = first + lane / 4 + 8 * half;
        if (lane % 4 == 0 && r < n.rows) n.out[3 * r + d] = total;
      }
    }
    __syncwarp();
  }
}

__global__ void __launch_bounds__(threads)
    pack_rows_kernel(int64_t rows, int columns, const float* source, uint32_t* packed) {
  const int64_t i = int64_t{blockIdx.x} * threads + threadIdx.x, row = i / (layer_width / 2);
  if (row >= rows) return;
  const int column = 2 * static_cast<int>(i % (layer_width / 2));
  const float* const from = source + row * columns + column;
  packed[i] = pack(column < columns ? from[0] : 0, column + 1 < columns ? from[1] : 0);
}

/// Launches with the shared memory that the kernel needs.
template <typename Kernel, typename Argument>
void launch(Kernel kernel, int blocks, int block_threads, int bytes, const Argument& argument, void* stream) {
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  kernel<<<blocks, block_threads, bytes, static_cast<cudaStream_t>(stream)>>>(argument);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

template <int operands, int warps>
void launch_forward(const RowNetwork& n, int resident, void* stream) {
  launch(forward_kernel<operands, warps>, blocks_for(n.rows, resident), 32 * warps,
         shared_bytes(warps, 1 + operands, 1), n, stream);
}

template <int operands>
int launch_backward(const RowNetworkGradient& d, void* stream) {
  constexpr int warps = many_warps;
  const int blocks = blocks_for(d.network.rows, 1);
  launch(backward_kernel<operands, warps>, blocks, 32 * warps, shared_bytes(warps, 1 + operands, 2), d, stream);
  return blocks;
}

int operands_of(const RowNetwork& n) { return n.operand[1].rows ? 2 : n.operand[0].rows ? 1 : 0; }

}  // namespace

void forward(const RowNetwork& network, void* stream) {
  if (network.rows == 0) return;
  switch (operands_of(network)) {
    case 0:
      return launch_forward<0, few_warps>(network, 2, stream);
    case 1:
      return launch_forward<1, few_warps>(network, 2, stream);
    default:
      return launch_forward<2, many_warps>(network, 1, stream);
  }
}

int backward(const RowNetworkGradient& gradient, void* stream) {
  switch (operands_of(gradient.network)) {
    case 0:
      return launch_backward<0>(gradient, stream);
    case 1:
      return launch_backward<1>(gradient, stream);
    default:
      return launch_backward<2>(gradient, stream);
  }
}

int most_norm_partials() { return multiprocessors(); }

void project(const RowProjection& projection, void* stream) {
  if (projection.rows == 0) return;
  launch(project_kernel, blocks_for(projection.rows, 2), threads, shared_bytes(few_warps, 2, 1), projection, stream);
}

void project_back(const ProjectionGradient& gradient, void* stream) {
  if (gradient.rows == 0) return;
  launch(project_back_kernel, blocks_for(gradient.rows, 2), threads, shared_bytes(few_warps, 2, 1), gradient, stream);
}

void sum_segments(const SegmentRows& segments, void* stream) {
  if (segments.segments == 0) return;
  constexpr int a_block = threads / 16;
  launch(sum_segments_kernel, static_cast<int>((segments.segments + a_block - 1) / a_block), threads, 0, segments,
         stream);
}

void pack_tiles(int count, const TileSource* sources, uint16_t* tiles, void* stream) {
  pack_tiles_kernel<<<count, threads, 0, static_cast<cudaStream_t>(stream)>>>(sources, tiles);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void make_tables(int count, const OffsetTable* tables, float* out, void* stream) {
  make_tables_kernel<<<dim3(static_cast<unsigned>(count), most_table_rows), layer_width, 0,
                       static_cast<cudaStream_t>(stream)>>>(tables, out);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void encode_features(const FeatureLayer& layer, void* stream) {
  if (layer.rows == 0) return;
  GRAUPEL_ASSERT(layer.width <= layer_width);
  encode_kernel<<<static_cast<unsigned>((layer.rows + feature_rows - 1) / feature_rows), layer_width, 0,
                  static_cast<cudaStream_t>(stream)>>>(layer);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

void decode(const Decoder& decoder, void* stream) {
  if (decoder.rows == 0) return;
  launch(decode_kernel, blocks_for(decoder.rows, 2), threads, shared_bytes(few_warps, 1, 1), decoder, stream);
}

void pack_rows(int64_t rows, int columns, const float* source, uint16_t* packed, void* stream) {
  if (rows == 0) return;
  GRAUPEL_ASSERT(columns <= layer_width);
  const auto blocks = static_cast<int>((rows * (layer_width / 2) + threads - 1) / threads);
  pack_rows_kernel<<<blocks, threads, 0, static_cast<cudaStream_t>(stream)>>>(rows, columns, source,
                                                                              reinterpret_cast<uint32_t*>(packed));
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

}  // namespace graupel::graph
