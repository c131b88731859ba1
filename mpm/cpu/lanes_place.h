// Where particles lie in the arenas of their home blocks, a particle in every lane (mpm/physics/transfer.h).
#pragma once

#include "mpm/cpu/cpu_step.h"
#include "mpm/cpu/lanes_matrix.h"
#include "mpm/grid/grid.h"
#include "mpm/particles/particles.h"

namespace graupel::mpm {
namespace {

constexpr int tile_lanes = static_cast<int>(tile);
/// Numbers in a row of an arena.
constexpr int row_stride = arena_row * channels;

/// Vectors that hold the three nodes of a row.
template <typename T>
constexpr int row_parts = (12 + width<T> - 1) / width<T>;

template <typename T, int K>
GRAUPEL_LANES Lanes<T> component(const T* data, int64_t tile_index, int k, int lane) {
  return load(data + (tile_index * K + k) * tile_lanes + lane);
}
template <typename T, int K>
GRAUPEL_LANES void set_component(T* data, int64_t tile_index, int k, int lane, Lanes<T> value) {
  store(data + (tile_index * K + k) * tile_lanes + lane, value);
}

/// Where particles lie in the arenas of their home blocks.
template <typename T>
struct LanePlace {
  Ints<T> offset;  ///< of the base node in the arena
  Lanes<T> fx[3];  ///< cells above it
};

/// `low`: lowest node of the home block. The base is kept inside the block, as arena_place() does.
template <typename T>
GRAUPEL_LANES LanePlace<T> place_of(const CpuStep<T>& s, int64_t tile_index, int lane, const Ints<T> (&low)[3]) {
  LanePlace<T> place;
  Ints<T> inside[3];
  for (int d = 0; d < 3; ++d) {
    const Lanes<T> local = (component<T, 3>(s.position, tile_index, d, lane) - s.origin[d]) * s.inverse_dx;
    const Ints<T> base = __builtin_convertvector(local - T(0.5), Ints<T>) - low[d];
    inside[d] = base < 0 ? Ints<T>{} : base > block_width - 1 ? Ints<T>{} + (block_width - 1) : base;
    place.fx[d] = local - __builtin_convertvector(low[d] + inside[d], Lanes<T>);
  }
  place.offset = (inside[0] * arena_width<> + inside[1]) * row_stride + inside[2] * channels;
  return place;
}

template <typename T>
GRAUPEL_LANES void spline_weights(Lanes<T> fx, Lanes<T> (&w)[3]) {
  const Lanes<T> low = T(1.5) - fx, mid = fx - T(1), high = fx - T(0.5);
  w[0] = T(0.5) * low * low;
  w[1] = T(0.75) - mid * mid;
  w[2] = T(0.5) * high * high;
}

}  // namespace
}  // namespace graupel::mpm
