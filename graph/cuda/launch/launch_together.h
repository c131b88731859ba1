// Launches of blocks that wait for each other (cooperative ones), in streams that may be recorded.
#pragma once

#include <cuda_runtime.h>

#include <algorithm>
#include <cstdint>

#include "core/parallel/cuda_check.h"

namespace graupel::graph {

inline int multiprocessors() {
  static const int count = [] {
    int device = 0, value = 0;
    GRAUPEL_CUDA_CHECK(cudaGetDevice(&device));
    GRAUPEL_CUDA_CHECK(cudaDeviceGetAttribute(&value, cudaDevAttrMultiProcessorCount, device));
    return value;
  }();
  return count;
}

/// As many blocks as there is work for, at most `resident` a multiprocessor. Blocks that do not wait for each other
/// need not be `together`.
template <typename Argument>
void launch_together(void (*kernel)(Argument), int64_t blocks, int threads, int shared_bytes, const Argument& argument,
                     void* stream, bool together = true, int resident = 1) {
  cudaLaunchAttribute attribute{};
  attribute.id = cudaLaunchAttributeCooperative;
  attribute.val.cooperative = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(static_cast<unsigned>(std::clamp<int64_t>(blocks, 1, int64_t{resident} * multiprocessors())));
  config.blockDim = dim3(static_cast<unsigned>(threads));
  config.dynamicSmemBytes = static_cast<std::size_t>(shared_bytes);
  config.stream = static_cast<cudaStream_t>(stream);
  config.attrs = &attribute;
  config.numAttrs = together ? 1 : 0;
  GRAUPEL_CUDA_CHECK(cudaLaunchKernelEx(&config, kernel, argument));
}

}  // namespace graupel::graph
