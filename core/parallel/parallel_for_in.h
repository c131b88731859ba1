// Launches and copies that take their place in a stream of a GPU.
#pragma once

#include <vector>

#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"

namespace graupel {

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

}  // namespace graupel
