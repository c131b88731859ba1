// The only portability macro: a function marked GRAUPEL_HD runs on the host and, where nvcc compiles it, on the device.
#pragma once

#include <cmath>

#if defined(__CUDACC__)
#define GRAUPEL_HD __host__ __device__
#else
#define GRAUPEL_HD
#endif

/// Kept out of hot host loops that rarely call it.
#if defined(__GNUC__) && !defined(__CUDA_ARCH__)
#define GRAUPEL_COLD __attribute__((noinline, cold))
#else
#define GRAUPEL_COLD
#endif

/// Before a loop over arrays that must stay in registers on a GPU.
#if defined(__CUDA_ARCH__)
#define GRAUPEL_UNROLL _Pragma("unroll")
#else
#define GRAUPEL_UNROLL
#endif

namespace graupel {

/// 1 / x and 1 / sqrt(x) to 2 units in the last place: one instruction on a GPU.
GRAUPEL_HD inline float fast_reciprocal(float x) {
#if defined(__CUDA_ARCH__)
  return __fdividef(1.0f, x);
#else
  return 1.0f / x;
#endif
}
GRAUPEL_HD inline float fast_inverse_root(float x) {
#if defined(__CUDA_ARCH__)
  return rsqrtf(x);
#else
  return 1.0f / std::sqrt(x);
#endif
}

}  // namespace graupel
