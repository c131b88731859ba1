// The threads of one CUDA block as an object. A kernel that needs shared memory and barriers is then an ordinary
// function template over this interface: GPUs run it with CudaBlock, tests on a CPU with fibers (tests/fiber_block.h).
#pragma once

#include <cstdint>

#include "core/host_device.h"

namespace graupel {

inline constexpr int warp_width = 32;

#ifdef __CUDACC__
struct CudaBlock {
  __device__ int index() const { return static_cast<int>(blockIdx.x); }
  __device__ int thread() const { return static_cast<int>(threadIdx.x); }
  __device__ int threads() const { return static_cast<int>(blockDim.x); }
  __device__ void sync() const { __syncthreads(); }
  __device__ void sync_warp() const { __syncwarp(); }
  /// Writes before it are seen by other blocks before writes after it.
  __device__ void fence() const { __threadfence(); }
  template <typename T>
  __device__ T add(T* place, T value) const {
    return atomicAdd(place, value);
  }
  template <typename T>
  __device__ T max(T* place, T value) const {
    return atomicMax(place, value);
  }
  template <typename T>
  __device__ T min(T* place, T value) const {
    return atomicMin(place, value);
  }
  template <typename T>
  __device__ T exchange(T* place, T value) const {
    return atomicExch(place, value);
  }
};
#endif

}  // namespace graupel
