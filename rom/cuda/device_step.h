// What the kernels of a reduced-order model's step share: sums over warps, stencils, coefficient maps, marked blocks.
//   branch   (device_branch.h)  coefficients of all fields, at q and where the velocity takes it; sums cleared;
//                               blocks marked that samples can read, where that is due
//   decode   (device_decode.h)  a warp decodes an integration point's fields and adds its contribution to its nodes; a
//                               block beside solves the normal equations for any ways of samples (device_equations.h)
//   gather   (device_gather.h)  a warp moves a sample; ways are projected onto the modes
//   fit      (device_fit.h)     a block finds the latent
// All are templates over core/parallel/thread_block.h: GPUs run them, and tests with fibers on a CPU.
#pragma once

#include <type_traits>

#include "core/parallel/thread_block.h"
#include "mpm/physics/node_update.h"
#include "mpm/physics/particle_motion.h"
#include "mpm/physics/transfer.h"
#include "rom/cuda/device_view.h"

#if defined(__CUDACC__)
#include <cuda_fp16.h>
#endif

namespace graupel::rom::device {

inline constexpr int step_warps = step_threads / warp_width;
inline constexpr int stencil_nodes = 27;
inline constexpr int block_nodes = mpm::block_width * mpm::block_width * mpm::block_width;

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

/// `inside`: the whole stencil lies in the grid (false for NaN).
struct GridStencil : mpm::Stencil<float, 3> {
  bool inside;
};

/// An instance's grid with its marked blocks, held by every thread that asks for nodes often.
struct MarkedGrid {
  mpm::GridGeometry<float, 3> grid;
  const long long* block_mark;
  float* sums;
  int32_t round;
  GRAUPEL_HD explicit MarkedGrid(const InstanceView& instance)
      : grid(instance.scene.grid), block_mark(instance.block_mark), sums(instance.sums), round(instance.state->round) {}

  GRAUPEL_HD int nodes(int axis) const { return mpm::block_width * grid.blocks[axis]; }
  GRAUPEL_HD GridStencil stencil_at(const Vec<float, 3>& x) const {
    const Vec<float, 3> local = grid.local(x);
    bool inside = true;
    for (int d = 0; d < 3; ++d) inside = inside && local[d] >= 0.5f && local[d] < static_cast<float>(nodes(d)) - 2.0f;
    if (!inside) return {{Vec<int, 3>::zero(), Vec<float, 3>::zero()}, false};
    return {mpm::stencil_at(local), true};
  }
  /// Of the block that holds a node.
  GRAUPEL_HD int32_t block_index(const Vec<int, 3>& at) const {
    return grid.directory_index({at[0] / mpm::block_width, at[1] / mpm::block_width, at[2] / mpm::block_width});
  }
  /// Whether a node's block is marked.
  GRAUPEL_HD bool is_marked(const Vec<int, 3>& at) const {
    return static_cast<int32_t>(block_mark[block_index(at)] >> 32) == round;
  }
  /// The four sums of a node; null where its block is not marked.
  GRAUPEL_HD float* sums_of(const Vec<int, 3>& at) const {
    const long long mark = block_mark[block_index(at)];
    if (static_cast<int32_t>(mark >> 32) != round) return nullptr;
    constexpr int w = mpm::block_width;
    const int inside = (at[0] % w * w + at[1] % w) * w + at[2] % w;
    return sums + ((mark & 0xffffffff) * block_nodes + inside) * mpm::channels;
  }
};
GRAUPEL_HD inline Vec<int, 3> stencil_node(int n) { return {n / 9, n / 3 % 3, n % 3}; }

/// y = (z - shift) * scale of input j.
GRAUPEL_HD inline double standardised(const MapView& map, int j, double z) { return (z - map.shift[j]) * map.scale[j]; }
/// The same clamped to the box of the centres.
GRAUPEL_HD inline double clamped(const MapView& map, int j, double y) {
  if (map.count == 0) return y;
  return y < map.low[j] ? map.low[j] : y > map.high[j] ? map.high[j] : y;
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
