// Runs body(i) for i in [0, n) on a device: the threads of core/parallel/thread_pool.h on the CPU, one CUDA thread an
// item on a GPU. Bodies are function objects over views with a GRAUPEL_HD operator()(int64_t) const. Items must be
// independent, so that results do not depend on the number of threads. Only files compiled as CUDA may launch on
// Device::cuda.
#pragma once

#include <cstdint>
#include <stdexcept>

#include "core/parallel/cuda_check.h"
#include "core/parallel/device.h"
#include "core/parallel/host_device.h"
#include "core/parallel/thread_pool.h"

/// Inline namespace of templates that launch kernels where their file is compiled as CUDA. A program has files of both
/// kinds, and the linker keeps one definition of a name: so the names differ.
#ifdef __CUDACC__
#define GRAUPEL_FILE_KIND with_cuda
#else
#define GRAUPEL_FILE_KIND without_cuda
#endif

namespace graupel {

#ifdef __CUDACC__
template <typename Body>
__global__ void parallel_for_kernel(int64_t n, Body body) {
  const int64_t i = static_cast<int64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < n) body(i);
}
#endif

/// Items that one CPU thread takes at a time: 1 for heavy items (a block of particles), thousands for light ones.
struct Grain {
  int64_t items = 256;
};

/// The CPU's part alone: no kernel for a GPU is compiled.
template <typename Body>
void parallel_for_cpu(int64_t n, const Body& body, Grain grain = {}) {
  if (n <= grain.items) {
    for (int64_t i = 0; i < n; ++i) body(i);
    return;
  }
  const auto run_chunk = [&](int64_t c) {
    const int64_t end = (c + 1) * grain.items < n ? (c + 1) * grain.items : n;
    for (int64_t i = c * grain.items; i < end; ++i) body(i);
  };
  using Chunk = decltype(run_chunk);
  run_chunks((n + grain.items - 1) / grain.items, &run_chunk,
             [](const void* chunk, int64_t c) { (*static_cast<const Chunk*>(chunk))(c); });
}

inline namespace GRAUPEL_FILE_KIND {

template <typename Body>
void parallel_for(Device device, int64_t n, const Body& body, Grain grain = {}) {
  if (n <= 0) return;
  if (device == Device::cpu) return parallel_for_cpu(n, body, grain);
#ifdef __CUDACC__
  constexpr int threads = 128;
  parallel_for_kernel<<<static_cast<unsigned>((n + threads - 1) / threads), threads>>>(n, body);
  GRAUPEL_CUDA_CHECK(cudaGetLastError());
#else
  throw std::logic_error("parallel_for: this file was not compiled for CUDA");
#endif
}

}  // namespace GRAUPEL_FILE_KIND

}  // namespace graupel
