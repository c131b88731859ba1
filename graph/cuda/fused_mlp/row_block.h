// What the kernels of row_layers.h share: a block's shared memory, its place among the rows, its launch.
#pragma once

#include <algorithm>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"
#include "graph/cuda/fused_mlp/tile_product.h"
#include "graph/cuda/launch/launch_together.h"

namespace graupel::graph::tile {

constexpr int threads = 256;
/// Warps of a block: as many as registers and shared memory allow, for their loads to overlap.
constexpr int few_warps = 8, many_warps = 12;
constexpr float slope = 0.01f;  ///< of HGN's activation
constexpr int types = 9;        ///< rows of the embedding table (graph/features/features.h)

/// Whether this GPU starts kernels before those that they depend on are done (compute capability 9.0).
inline bool launches_ahead() {
  static const bool can = [] {
    int device = 0, major = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device));
    return major >= 9;
  }();
  return can;
}

/// First row of a warp: neighbouring rows go to different blocks, so that few rows keep many multiprocessors busy.
__device__ inline int64_t first_row(int warp) { return (int64_t{warp} * gridDim.x + blockIdx.x) * warp_rows; }

/// Rows that there are, of `most`.
__device__ inline int64_t rows_now(int64_t most, const int32_t* count) { return count ? *count : most; }

/// Blocks for `rows` rows when `resident` of them run on a multiprocessor at a time.
inline int blocks_for(int64_t rows, int resident) {
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

/// c += rows [*, 128] that lie as this warp's rows do. All are read before anything is written that they may overlap:
/// they are under way together.
__device__ inline void add_rows(Sums& c, const uint16_t* from, int64_t first, int64_t rows, int lane) {
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
    const uint32_t* const words = reinterpret_cast<const uint32_t*>(from + r * layer_width) + lane % 4;
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 v = unpack(words[4 * j]);
      c[j][2 * half] += v.x;
      c[j][2 * half + 1] += v.y;
    }
  }
}

/// c becomes the sum that is written.
__device__ inline void write_operand_gradient(const OperandGradient& d, Sums& c, int64_t first, int64_t rows,
                                              int lane) {
  if (d.add32) add_table(c, d.add32, {}, first, rows, lane);
  if (d.add16) add_rows(c, d.add16, first, rows, lane);
#pragma unroll
  for (int half = 0; half < 2; ++half) {
    const int64_t r = first + lane / 4 + 8 * half;
    if (r >= rows) continue;
    const int64_t at = r * layer_width + 2 * (lane % 4);
#pragma unroll
    for (int j = 0; j < column_blocks; ++j) {
      const float2 sum{c[j][2 * half], c[j][2 * half + 1]};
      if (d.d32) *reinterpret_cast<float2*>(d.d32 + at + 8 * j) = sum;
      if (d.d16) *reinterpret_cast<uint32_t*>(d.d16 + at + 8 * j) = pack(sum.x, sum.y);
    }
  }
}

/// Launches with the shared memory that the kernel needs.
template <typename Kernel, typename Argument>
void launch(Kernel kernel, int blocks, int block_threads, int bytes, const Argument& argument, void* stream) {
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  kernel<<<blocks, block_threads, bytes, static_cast<cudaStream_t>(stream)>>>(argument);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
}

/// Of a kernel that was launched ahead: lets the next one start, and waits until the one before is done. Before it a
/// kernel may read weights alone.
__device__ inline void start_next() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;" ::: "memory");
#endif
}
__device__ inline void wait_for_previous() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
}

/// Launches a kernel that calls both while the one before it in the stream still runs: it reads its weights meanwhile
/// (programmatic dependent launch). Weights must not be written by the launch just before. The default stream's kernels
/// follow each other.
template <typename Kernel, typename Argument>
void launch_ahead(Kernel kernel, int blocks, int block_threads, int bytes, const Argument& argument, void* stream) {
  if (stream == nullptr || !launches_ahead()) return launch(kernel, blocks, block_threads, bytes, argument, stream);
  GRAUPEL_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes));
  cudaLaunchAttribute ahead{};
  ahead.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  ahead.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(static_cast<unsigned>(blocks));
  config.blockDim = dim3(static_cast<unsigned>(block_threads));
  config.dynamicSmemBytes = static_cast<std::size_t>(bytes);
  config.stream = static_cast<cudaStream_t>(stream);
  config.attrs = &ahead;
  config.numAttrs = 1;
  GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&config, kernel, argument));
}

}  // namespace graupel::graph::tile
