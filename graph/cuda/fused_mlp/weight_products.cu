// Gradients of weights: sums over rows of outer products, on tensor cores. Rows are split into chunks, each a block's;
// a second launch adds the chunks in their order.
#include <algorithm>

#include "core/parallel/buffer.h"
#include "core/parallel/cuda_check.h"
#include "core/parallel/parallel_for_in.h"
#include "graph/cuda/fused_mlp/row_layers.h"
#include "graph/cuda/fused_mlp/tile_product.h"

namespace graupel::graph {

namespace {

using namespace tile;

constexpr int warps = 8;
constexpr int threads = 32 * warps;
constexpr int stage_rows = 64;
constexpr int stage_bytes = stage_rows * row_stride * 2;
constexpr int most_chunks = 64;
constexpr int least_chunk = 2048;

/// Rows [first, first + rows) of a product; its partial sums.
struct Chunk {
  const uint16_t *d, *x;
  int64_t first, rows;
  float* sums;  ///< [128, 128]
  float* bias;  ///< [128] or null
};

/// How a product's chunks are added.
struct Addition {
  const float *sums, *bias;
  int64_t parts;
  float *out, *out_bias;
  int32_t stride, columns;
};

__device__ void copy_async(uint16_t* to, const uint16_t* from, bool there) {
  const int bytes = there ? 16 : 0;  // the rest is filled with 0
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;" ::"r"(shared_address(to)), "l"(from), "r"(bytes)
               : "memory");
}

/// Starts to copy a stage's rows of d and x.
__device__ void load_stage(uint16_t* d, uint16_t* x, const Chunk& chunk, int64_t stage) {
  constexpr int words = layer_width / 8;
  for (int i = static_cast<int>(threadIdx.x); i < stage_rows * words; i += threads) {
    const int row = i / words, word = i % words;
    const int64_t r = stage * stage_rows + row;
    const bool there = r < chunk.rows;
    const int64_t from = (chunk.first + (there ? r : 0)) * layer_width + 8 * word;
    copy_async(d + row * row_stride + 8 * word, chunk.d + from, there);
    copy_async(x + row * row_stride + 8 * word, chunk.x + from, there);
  }
  asm volatile("cp.async.commit_group;" ::: "memory");
}

/// A warp adds 32 x 64 sums: outputs from 32 (warp / 2) on, inputs from 64 (warp % 2) on. Where `with_bias`, products
/// with ones add the rows of d.
__device__ void add_stage(float (&c)[2][8][4], float (&bias)[2][4], bool with_bias, const uint16_t* d,
                          const uint16_t* x, int warp, int lane) {
  constexpr uint32_t ones = 0x3f803f80;
  const int m = lane / 8, r = lane % 8;
  const uint32_t d_at = shared_address(d + ((m / 2) * 8 + r) * row_stride + 32 * (warp / 2) + (m % 2) * 8);
  const uint32_t x_at = shared_address(x + ((m % 2) * 8 + r) * row_stride + 64 * (warp % 2) + (m / 2) * 8);
#pragma unroll
  for (int k = 0; k < stage_rows; k += 16) {
    uint32_t a[2][4];
    load_transposed(a[0], d_at + 2 * k * row_stride);
    load_transposed(a[1], d_at + 2 * (k * row_stride + 16));
    if (with_bias)
#pragma unroll
      for (int i = 0; i < 2; ++i) multiply_add(bias[i], a[i], ones, ones);
#pragma unroll
    for (int j = 0; j < 8; j += 2) {
      uint32_t b[4];
      load_transposed(b, x_at + 2 * (k * row_stride + 8 * j));
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        multiply_add(c[i][j], a[i], b[0], b[1]);
        multiply_add(c[i][j + 1], a[i], b[2], b[3]);
      }
    }
  }
}

extern __shared__ __align__(16) uint16_t product_numbers[];

__global__ void __launch_bounds__(threads, 2) product_kernel(const Chunk* chunks) {
  const Chunk chunk = chunks[blockIdx.x];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const auto d_stage = [&](int64_t s) { return product_numbers + (s % 2) * stage_bytes; };  // 2 parts of a stage
  const auto x_stage = [&](int64_t s) { return d_stage(s) + stage_bytes / 2; };
  const int64_t stages = (chunk.rows + stage_rows - 1) / stage_rows;
  float c[2][8][4] = {};
  float bias[2][4] = {};
  const bool with_bias = chunk.bias && warp % 2 == 0;
  load_stage(d_stage(0), x_stage(0), chunk, 0);
  for (int64_t s = 0; s < stages; ++s) {
    if (s + 1 < stages) {
      load_stage(d_stage(s + 1), x_stage(s + 1), chunk, s + 1);
      asm volatile("cp.async.wait_group 1;" ::: "memory");
    } else {
      asm volatile("cp.async.wait_group 0;" ::: "memory");
    }
    __syncthreads();
    add_stage(c, bias, with_bias, d_stage(s), x_stage(s), warp, lane);
    __syncthreads();
  }
#pragma unroll
  for (int i = 0; i < 2; ++i)
#pragma unroll
    for (int j = 0; j < 8; ++j)
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const int row = 32 * (warp / 2) + 16 * i + 8 * half + lane / 4,
                  column = 64 * (warp % 2) + 8 * j + 2 * (lane % 4);
        *reinterpret_cast<float2*>(chunk.sums + row * layer_width + column) = {c[i][j][2 * half],
                                                                               c[i][j][2 * half + 1]};
      }
  if (!with_bias || lane % 4 != 0) return;
#pragma unroll
  for (int i = 0; i < 2; ++i) {
    chunk.bias[32 * (warp / 2) + 16 * i + lane / 4] = bias[i][0];
    chunk.bias[32 * (warp / 2) + 16 * i + 8 + lane / 4] = bias[i][2];
  }
}

constexpr int addition_blocks = tile_numbers / threads;

/// Block (x, y): 256 numbers of addition y; the last x has the bias.
__global__ void __launch_bounds__(threads) add_kernel(const Addition* additions) {
  const Addition a = additions[blockIdx.y];
  const int block = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  if (block == addition_blocks) {
    if (!a.out_bias || thread >= layer_width) return;
    float sum = 0;
    for (int64_t p = 0; p < a.parts; ++p) sum += a.bias[p * layer_width + thread];
    a.out_bias[thread] = sum;
    return;
  }
  const int number = block * threads + thread, row = number / layer_width, column = number % layer_width;
  if (!a.out || column >= a.columns) return;
  float sum = 0;
  for (int64_t p = 0; p < a.parts; ++p) sum += a.sums[p * tile_numbers + number];
  a.out[int64_t{row} * a.stride + column] = sum;
}

/// Block (x, y): 32 numbers of partial sums y; a warp adds every eighth row.
__global__ void __launch_bounds__(threads) add_partials_kernel(const PartialSums* all) {
  const PartialSums a = all[blockIdx.y];
  __shared__ float sums[warps][32];
  const int lane = static_cast<int>(threadIdx.x) % 32, warp = static_cast<int>(threadIdx.x) / 32;
  const int number = 32 * static_cast<int>(blockIdx.x) + lane, numbers = a.parts * layer_width;
  if (number >= numbers) return;  // the whole block
  float sum = 0;
#pragma unroll 4
  for (int64_t r = warp; r < a.rows; r += warps) sum += a.partial[r * numbers + number];
  sums[warp][lane] = sum;
  __syncthreads();
  if (warp > 0) return;
  sum = 0;
  for (const auto& part : sums) sum += part[lane];
  const int i = number % layer_width, k = number / layer_width;
  if (a.bias == nullptr || k + 1 < a.parts)
    a.out[int64_t{i} * a.stride + int64_t{k} * a.step] = sum;
  else if (i < a.biases)
    a.bias[i] = sum;
}
constexpr int most_parts = 4;

int64_t chunk_rows(int64_t rows) {
  const int64_t even = (rows + most_chunks - 1) / most_chunks;
  return std::max<int64_t>(least_chunk, (even + stage_rows - 1) / stage_rows * stage_rows);
}

}  // namespace

struct WeightProducts::Memory {
  Buffer<Chunk> chunks{Device::cuda, 0};
  Buffer<Addition> additions{Device::cuda, 0};
  Buffer<PartialSums> partials{Device::cuda, 0};
  Buffer<float> sums{Device::cuda, 0};
};

WeightProducts::WeightProducts() : memory_(std::make_unique<Memory>()) {}
WeightProducts::~WeightProducts() = default;

void WeightProducts::run(void* stream) {
  int64_t parts = 0;
  for (const WeightProduct& p : products_)
    if (p.rows > 0) parts += (p.rows + chunk_rows(p.rows) - 1) / chunk_rows(p.rows);
  constexpr int64_t part_numbers = tile_numbers + layer_width;
  memory_->sums.resize_discard(static_cast<std::size_t>(parts * part_numbers));
  float* sums = memory_->sums.data();
  float* bias = sums + parts * tile_numbers;
  std::vector<Chunk> chunks;
  std::vector<Addition> additions;
  for (const WeightProduct& p : products_) {
    const float *const first_sums = sums, *const first_bias = bias;
    int64_t n = 0;
    for (int64_t first = 0; first < p.rows; first += chunk_rows(p.rows), ++n) {
      chunks.push_back({p.d, p.x, first, std::min(chunk_rows(p.rows), p.rows - first), sums, p.bias ? bias : nullptr});
      sums += tile_numbers;
      bias += layer_width;
    }
    additions.push_back({first_sums, first_bias, n, p.out, p.bias, p.stride, p.columns});
  }
  products_.clear();
  upload_in(stream, memory_->chunks, chunks);
  upload_in(stream, memory_->additions, additions);
  upload_in(stream, memory_->partials, partials_);
  const auto in = static_cast<cudaStream_t>(stream);
  constexpr int bytes = 4 * stage_bytes;
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(product_kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  if (!chunks.empty())
    product_kernel<<<static_cast<unsigned>(chunks.size()), threads, bytes, in>>>(memory_->chunks.data());
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  if (!additions.empty())
    add_kernel<<<dim3(addition_blocks + 1, static_cast<unsigned>(additions.size())), threads, 0, in>>>(
        memory_->additions.data());
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  if (!partials_.empty())
    add_partials_kernel<<<dim3(most_parts * layer_width / 32, static_cast<unsigned>(partials_.size())), threads, 0,
                          in>>>(memory_->partials.data());
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
  partials_.clear();
}

}  // namespace graupel::graph
