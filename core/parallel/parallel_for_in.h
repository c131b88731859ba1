// Launches and copies that take their place in a stream of a GPU.
#pragma once

#include <algorithm>
#include <vector>

#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"
#ifdef __CUDACC__
#include "core/parallel/launch_items.cuh"
#endif

namespace graupel {
inline namespace GRAUPEL_FILE_KIND {

/// `stream`: the cudaStream_t to launch on; null: the default one. On the CPU done when it returns.
template <typename Body>
void parallel_for_in(void* stream, Device device, int64_t n, const Body& body, Grain grain = {}) {
#ifdef __CUDACC__
  if (device == Device::cuda && n > 0) {
    constexpr int threads = 128;
    parallel_for_kernel<<<static_cast<unsigned>((n + threads - 1) / threads), threads, 0,
                          static_cast<cudaStream_t>(stream)>>>(n, body);
    GRAUPEL_CUDA_CHECK(cudaGetLastError());
    return;
  }
#endif
  static_cast<void>(stream);
  parallel_for(device, n, body, grain);
}

/// body(i) for i in [0, n).
template <typename Body>
struct Loop {
  int64_t n;
  Body body;
};

/// parallel_for_in for each of some independent loops; on a GPU many of them in one launch.
template <typename Body>
void parallel_loops_in(void* stream, Device device, const std::vector<Loop<Body>>& loops, Grain grain = {}) {
#ifdef __CUDACC__
  if (device == Device::cuda && loops.size() > 1) {
    constexpr int threads = 128;
    int64_t most = 0;
    for (const Loop<Body>& loop : loops) most = std::max(most, loop.n);
    if (most == 0) return;
    const auto blocks = static_cast<unsigned>((most + threads - 1) / threads);
    launch_items(loops, [&](const auto& items, unsigned count) {
      loops_kernel<<<dim3(blocks, count), threads, 0, static_cast<cudaStream_t>(stream)>>>(items);
    });
    return;
  }
#endif
  for (const Loop<Body>& loop : loops) parallel_for_in(stream, device, loop.n, loop.body, grain);
}

/// Copies a small array in a stream's order; the source may go at once.
template <typename T>
void upload_in(void* stream, Buffer<T>& buffer, const std::vector<T>& values) {
  buffer.resize_discard(values.size());
#ifdef __CUDACC__
  if (buffer.device() == Device::cuda) {
    GRAUPEL_CUDA_CHECK(cudaMemcpyAsync(buffer.data(), values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice,
                                       static_cast<cudaStream_t>(stream)));
    return;
  }
#endif
  static_cast<void>(stream);
  device_copy(buffer.device(), buffer.data(), Device::cpu, values.data(), values.size() * sizeof(T));
}

}  // namespace GRAUPEL_FILE_KIND
}  // namespace graupel
