// The threads of one CUDA block as an object. A kernel that needs shared memory and barriers is then an ordinary
// function template over this interface: GPUs run it with CudaBlock, tests on a CPU with fibers (tests/fiber_block.h).
#pragma once

#include <cstdint>

#include "core/parallel/host_device.h"

namespace graupel {

inline constexpr int warp_width = 32;

#ifdef __CUDACC__
struct CudaBlock {
  __device__ int index() const { return static_cast<int>(blockIdx.x); }
  __device__ int thread() const { return static_cast<int>(threadIdx.x); }
  __device__ int threads() const { return static_cast<int>(blockDim.x); }
  __device__ int blocks() const { return static_cast<int>(gridDim.x); }
  __device__ void sync() const { __syncthreads(); }
  __device__ void sync_warp() const { __syncwarp(); }
  /// Bit l: whether lane l says yes. All lanes of the warp must ask.
  __device__ uint32_t ballot(bool yes) const { return __ballot_sync(0xffffffffu, yes); }
  /// `value` of the lane whose number differs in the bits of `mask`. All lanes of the warp must take part.
  __device__ float shuffle_xor(float value, int mask) const { return __shfl_xor_sync(0xffffffffu, value, mask); }
  /// Counts this block at a barrier after all that it wrote. Unlike fence(), this leaves the multiprocessor's own cache
  /// alone: whoever goes on must read with fresh() what other blocks wrote.
  __device__ void arrive(uint32_t* arrivals, uint32_t count) const {
    asm volatile("red.release.gpu.global.add.u32 [%0], %1;" ::"l"(__cvta_generic_to_global(arrivals)), "r"(count)
                 : "memory");
  }
  /// Adds to a sum in global memory.
  __device__ void add_units(long long* sum, long long units) const {
    asm volatile("red.global.add.u64 [%0], %1;" ::"l"(__cvta_generic_to_global(sum)), "l"(units) : "memory");
  }
  __device__ long long nearest_integer(float value) const { return __float2ll_rn(value); }
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
  /// What other blocks last wrote, past this multiprocessor's own cache.
  template <typename T>
  __device__ T fresh(const T* place) const {
    if constexpr (sizeof(T) == sizeof(float4)) {
      const float4 word = __ldcg(reinterpret_cast<const float4*>(place));
      T value;
      __builtin_memcpy(&value, &word, sizeof(T));
      return value;
    } else {
      return *static_cast<const volatile T*>(place);
    }
  }
  /// Back-off in a spin wait on another block's flag.
  __device__ void pause() const {}
};
#endif

}  // namespace graupel
