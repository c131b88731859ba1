// What the kernels of a reduced-order model's step share: sums over warps, stencils, coefficient maps, marked nodes.
//   branch   (device_branch.h)  coefficients of all fields, at q and where the velocity takes it; sums cleared; nodes
//                               marked that samples can read, where that is due
//   decode   (device_decode.h)  a warp decodes an integration point's fields and adds its share to its nodes
//   gather   (device_gather.h)  a warp moves a sample; ways are projected onto the modes
//   fit      (device_fit.h)     a block solves for the latent
// All are templates over core/thread_block.h: GPUs run them, and tests with fibers on a CPU.
#pragma once

#include <type_traits>

#include "core/thread_block.h"
#include "mpm/moving_contact.h"
#include "mpm/particle_motion.h"
#include "rom/cuda/device_view.h"

#if defined(__CUDACC__)
#include <cuda_fp16.h>
#endif

namespace graupel::rom::device {

inline constexpr int step_warps = step_threads / warp_width;
inline constexpr int stencil_nodes = 27;

/// IEEE half precision.
GRAUPEL_HD inline float float_of_half(uint16_t bits) {
#if defined(__CUDA_ARCH__)
  return __half2float(__ushort_as_half(bits));
#else
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  const float magnitude = exponent == 0    ? std::ldexp(static_cast<float>(fraction), -24)
                          : exponent == 31 ? (fraction != 0 ? NAN : INFINITY)
                                           : std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
  return bits >> 15 != 0 ? -magnitude : magnitude;
#endif
}

/// Bits that are set.
GRAUPEL_HD inline int32_t ones_of(uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return __popc(bits);
#else
  return __builtin_popcount(bits);
#endif
}

/// `value` of the lane whose number differs in the bits of `mask`.
template <typename Block>
GRAUPEL_HD inline double shuffle_xor(const Block& block, double value, int mask) {
  float halves[2];
  __builtin_memcpy(halves, &value, sizeof value);
  for (float& half : halves) half = block.shuffle_xor(half, mask);
  __builtin_memcpy(&value, halves, sizeof value);
  return value;
}
template <typename Block>
GRAUPEL_HD inline float shuffle_xor(const Block& block, float value, int mask) {
  return block.shuffle_xor(value, mask);
}

/// Sum over the lanes of a warp, the same in all of them.
template <typename Block, typename T>
GRAUPEL_HD inline T sum_of_warp(const Block& block, T value) {
  for (int mask = warp_width / 2; mask > 0; mask /= 2) value += shuffle_xor(block, value, mask);
  return value;
}

/// Base node of a position and the cells above it; `inside`: the whole stencil lies in the grid (false for NaN).
struct Stencil {
  Vec<int, 3> base;
  Vec<float, 3> fx;
  bool inside;
};
GRAUPEL_HD inline Stencil stencil_at(const InstanceView& instance, const Vec<float, 3>& x) {
  const Vec<float, 3> local = instance.scene.grid.local(x);
  Stencil s{Vec<int, 3>::zero(), Vec<float, 3>::zero(), true};
  for (int d = 0; d < 3; ++d)
    s.inside = s.inside && local[d] >= 0.5f && local[d] < static_cast<float>(instance.nodes[d]) - 2.0f;
  if (!s.inside) return s;
  s.base = mpm::base_node(local);
  for (int d = 0; d < 3; ++d) s.fx[d] = local[d] - static_cast<float>(s.base[d]);
  return s;
}
GRAUPEL_HD inline int64_t node_number(const Vec<int, 3>& nodes, const Vec<int, 3>& at) {
  return (int64_t(at[0]) * nodes[1] + at[1]) * nodes[2] + at[2];
}
GRAUPEL_HD inline Vec<int, 3> stencil_node(int n) { return {n / 9, n / 3 % 3, n % 3}; }

/// y = (z - shift) * scale of input j.
GRAUPEL_HD inline double standardised(const MapView& map, int j, double z) { return (z - map.shift[j]) * map.scale[j]; }
/// The same held at the box of the centres.
GRAUPEL_HD inline double held(const MapView& map, int j, double y) {
  if (map.count == 0) return y;
  return y < map.low[j] ? map.low[j] : y > map.high[j] ? map.high[j] : y;
}

/// Place of a marked node among the sums, or -1.
GRAUPEL_HD inline int32_t place_of(const InstanceView& instance, int64_t node, int32_t round) {
  const long long mark = instance.node_mark[node];
  return static_cast<int32_t>(mark >> 32) == round ? static_cast<int32_t>(mark & 0xffffffff) : -1;
}

/// Position of a sample with these coefficients of the deformation, in all lanes [m].
template <typename Block>
GRAUPEL_HD Vec<double, 3> sample_position(const Block& block, const ModelView& model, const double* coefficient,
                                          int sample) {
  const int lane = block.thread() % warp_width;
  Vec<double, 3> x = Vec<double, 3>::zero();
  for (int k = lane; k < model.deformation_modes; k += warp_width)
    for (int c = 0; c < 3; ++c)
      x[c] += static_cast<double>(model.sample_modes[int64_t(k) * model.sample_rows + 3 * sample + c]) * coefficient[k];
  for (int c = 0; c < 3; ++c) x[c] = sum_of_warp(block, x[c]) + model.sample_mean[3 * sample + c];
  return x;
}

}  // namespace graupel::rom::device
