// Networks of two layers over rows: forward, and backward with recomputation.
#include "graph/cuda/fused_mlp/row_block.h"
#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

namespace {

using namespace tile;

/// c += the features of this warp's rows times their matrix.
__device__ void add_features(Sums& c, const RowFeatures& features, int64_t first, int64_t rows, int lane) {
  float4 x[2] = {{0, 0, 0, 0}, {0, 0, 0, 0}};
#pragma unroll
  for (int half = 0; half < 2; ++half)
    if (const int64_t r = first + lane / 4 + 8 * half; r < rows)
      x[half] = reinterpret_cast<const float4*>(features.values)[r];
  const float4* const weight = reinterpret_cast<const float4*>(features.weight) + 2 * (lane % 4);
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 2; ++i) {
      const float4 w = weight[8 * j + i];
#pragma unroll
      for (int half = 0; half < 2; ++half)
        c[j][2 * half + i] += w.x * x[half].x + w.y * x[half].y + w.z * x[half].z + w.w * x[half].w;
    }
}

/// First-layer sums of a warp's rows; with `keep`, operands are saved where the network asks for it.
template <int operands, int warps>
__device__ void first_layer(Sums& c, const FusedMlp& n, int64_t rows, const Shared<warps>& shared, uint16_t* mine,
                            int64_t first, int lane) {
  clear(c);
#pragma unroll
  for (int j = 0; j < operands; ++j) {
    gather_rows(mine, n.operand[j], first, rows, lane);
    __syncwarp();
    product(c, mine, shared.tile(1 + j), lane);
    if (n.operand[j].save) copy_out(n.operand[j].save, mine, first, rows, lane);
    __syncwarp();
  }
  if constexpr (operands == 0)
    if (n.features.values) add_features(c, n.features, first, rows, lane);
#pragma unroll
  for (int t = 0; t < 3; ++t)
    if (n.table[t].table) add_table(c, n.table[t].table, n.table[t].row, first, rows, lane);
#pragma unroll
  for (int j = 0; j < column_blocks; ++j)
#pragma unroll
    for (int i = 0; i < 4; ++i) c[j][i] = c[j][i] > 0 ? c[j][i] : n.slope * c[j][i];
}

template <int operands, int warps>
__device__ void load_weights(const FusedMlp& n, const Shared<warps>& shared) {
  load_tile(shared.tile(0), n.w2);
#pragma unroll
  for (int j = 0; j < operands; ++j) load_tile(shared.tile(1 + j), n.operand[j].weight);
}

/// What follows the layer norm: residual sums in bf16 and f32; c becomes the last.
__device__ void write_sums(const FusedMlp& n, int64_t rows, Sums& c, int64_t first, int lane) {
  if (n.sum16) {
    Sums sum;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j)
#pragma unroll
      for (int i = 0; i < 4; ++i) sum[j][i] = c[j][i];
    write_operand_gradient({nullptr, nullptr, n.add16, n.sum16}, sum, first, rows, lane);
  }
  if (n.sum32) write_operand_gradient({n.add32, n.sum32, nullptr, n.copy16}, c, first, rows, lane);
}

/// Weighted sums of the first and the last eight of a warp's rows.
__device__ void write_groups(const FusedMlp& n, int64_t rows, const Sums& c, int64_t first, int lane) {
  constexpr int group_rows = 8;
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t begin = first + half * group_rows;
    if (begin >= rows) continue;  // the same for the whole warp
    const float weight = n.group_weight[begin + lane / 4];
    float values[2 * column_blocks], sums[4] = {0, 0, 0, 0};
#pragma unroll
    for (int j = 0; j < column_blocks; ++j)
#pragma unroll
      for (int i = 0; i < 2; ++i) values[2 * j + i] = weight * c[j][2 * half + i];
    fold(values, sums, lane);
    const int64_t at = begin / group_rows * layer_width + folded_column(0, lane);
#pragma unroll
    for (int k = 0; k < 2; ++k) {
      const float2 before = *reinterpret_cast<const float2*>(n.group_add32 + at + 8 * k);
      *reinterpret_cast<float2*>(n.group32 + at + 8 * k) = {before.x + sums[2 * k], before.y + sums[2 * k + 1]};
    }
  }
}

/// What comes after the layer norm of a network with an epilogue: sum32, copy16 and the epilogue.
template <int warps>
__device__ void write_epilogue(const FusedMlp& n, int64_t rows, Sums& c, const Shared<warps>& shared, uint16_t* mine,
                               int64_t first, int lane) {
  add_table(c, n.add32, {}, first, rows, lane);
  write_operand_gradient({nullptr, n.sum32}, c, first, rows, lane);
  store_rows(mine, c, lane);
  __syncwarp();
  copy_out(n.copy16, mine, first, rows, lane);
#pragma unroll
  for (int j = 0; j < 2; ++j) {
    if (!n.epilogue.weight[j]) continue;
    clear(c);
    product(c, mine, shared.tile(3 + j), lane);
    if (n.epilogue.bias[j]) add_bias(c, n.epilogue.bias[j], lane);
    write_operand_gradient({nullptr, n.epilogue.out[j], nullptr, n.epilogue.out16[j]}, c, first, rows, lane);
  }
  __syncwarp();
}

enum class After { sums, groups, epilogue };  ///< what follows the layer norm

template <int operands, int warps, After after = After::sums>
__global__ void __launch_bounds__(32 * warps, operands == 2 ? 1 : 2) forward_kernel(FusedMlp n) {
  start_next();
  const Shared<warps> shared{shared_numbers, 1 + operands + (after == After::epilogue ? 2 : 0)};
  if constexpr (after == After::epilogue)
    for (int j = 0; j < 2; ++j)
      if (n.epilogue.weight[j]) load_tile(shared.tile(3 + j), n.epilogue.weight[j]);
  load_weights<operands>(n, shared);
  wait_for_previous();
  const int64_t rows = rows_now(n.rows, n.row_count);
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t* const mine = shared.rows(0, warp);
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < rows; first += step) {
    Sums c;
    first_layer<operands>(c, n, rows, shared, mine, first, lane);
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
      copy_out(n.out16, mine, first, rows, lane);
      __syncwarp();
    }
    if constexpr (after == After::groups)
      write_groups(n, rows, c, first, lane);
    else if constexpr (after == After::epilogue)
      write_epilogue(n, rows, c, shared, mine, first, lane);
    else
      write_sums(n, rows, c, first, lane);
  }
}

/// Gradient of a warp's rows' results.
__device__ void result_gradient(Sums& g, const FusedMlpGradient& d, int64_t first, int lane) {
  clear(g);
  const int64_t rows = d.network.rows;
  if (d.g32) add_table(g, d.g32, d.g_row, first, rows, lane);
  if (d.g16) add_rows(g, d.g16, first, rows, lane);
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

template <int operands, int warps>
__global__ void __launch_bounds__(32 * warps, 1) backward_kernel(FusedMlpGradient d) {
  const FusedMlp& n = d.network;
  const Shared<warps> shared{shared_numbers, 1 + operands};
  load_weights<operands>(n, shared);
  wait_for_tiles();
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  uint16_t *const hidden = shared.rows(0, warp), *const raw = shared.rows(1, warp);
  float gamma_sums[4] = {0, 0, 0, 0}, beta_sums[4] = {0, 0, 0, 0};
  const int64_t step = int64_t{gridDim.x} * warps * warp_rows;
  for (int64_t first = first_row(warp); first < n.rows; first += step) {
    Sums c;
    first_layer<operands>(c, n, n.rows, shared, hidden, first, lane);
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
      c[j][0] *= a.x > 0 ? 1.0f : n.slope, c[j][1] *= a.y > 0 ? 1.0f : n.slope;
      c[j][2] *= b.x > 0 ? 1.0f : n.slope, c[j][3] *= b.y > 0 ? 1.0f : n.slope;
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
#pragma unroll
  for (int i = 0; i < 4; ++i) {
    const int column = folded_column(i, lane);
    sums[warp * 2 * layer_width + column] = gamma_sums[i];
    sums[warp * 2 * layer_width + layer_width + column] = beta_sums[i];
  }
  __syncthreads();
  if (threadIdx.x >= 2 * layer_width) return;
  float total = 0;
  for (int w = 0; w < warps; ++w) total += sums[w * 2 * layer_width + static_cast<int>(threadIdx.x)];
  d.norm_partial[int64_t{blockIdx.x} * 2 * layer_width + threadIdx.x] = total;
}

template <int operands, int warps, After after = After::sums>
void launch_forward(const FusedMlp& n, int resident, void* stream) {
  constexpr int tiles = 1 + operands + (after == After::epilogue ? 2 : 0);
  launch_ahead(forward_kernel<operands, warps, after>, blocks_for(n.rows, resident), 32 * warps,
               shared_bytes(warps, tiles, 1), n, stream);
}

template <int operands>
int launch_backward(const FusedMlpGradient& d, void* stream) {
  constexpr int warps = many_warps;
  const int blocks = blocks_for(d.network.rows, 1);
  launch(backward_kernel<operands, warps>, blocks, 32 * warps, shared_bytes(warps, 1 + operands, 2), d, stream);
  return blocks;
}

int operands_of(const FusedMlp& n) { return n.operand[1].rows ? 2 : n.operand[0].rows ? 1 : 0; }

}  // namespace

void forward(const FusedMlp& network, void* stream) {
  if (network.rows == 0) return;
  const int operands = operands_of(network);
  if (network.group32) {
    GRAUPEL_ASSERT(operands == 0 && !network.sum32 && !network.sum16);
    return launch_forward<0, few_warps, After::groups>(network, 2, stream);
  }
  if (network.epilogue.weight[0]) {
    GRAUPEL_ASSERT(operands == 2 && network.add32 && network.sum32 && network.copy16 && !network.sum16);
    return launch_forward<2, many_warps, After::epilogue>(network, 1, stream);
  }
  switch (operands) {
    case 0:
      return launch_forward<0, few_warps>(network, 2, stream);
    case 1:
      return launch_forward<1, few_warps>(network, 2, stream);
    default:
      return launch_forward<2, many_warps>(network, 1, stream);
  }
}

bool can_project_ahead() {
  static const bool can = [] {
    int device = 0, bytes = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, device));
    return bytes >= shared_bytes(many_warps, 5, 1);
  }();
  return can;
}

int backward(const FusedMlpGradient& gradient, void* stream) {
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

}  // namespace graupel::graph
