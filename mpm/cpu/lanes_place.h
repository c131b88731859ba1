// Where particles lie in the arenas of their owner blocks, a particle in every lane. Equals arena_stencil() of
// mpm/physics/transfer.h.
#pragma once

#include "mpm/cpu/cpu_step.h"
#include "mpm/cpu/pack.h"
#include "mpm/grid/grid.h"
#include "mpm/particles/particles.h"
#include "mpm/physics/stencil.h"

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

/// Where particles lie in the arenas of their owner blocks.
template <typename T>
struct LanePlace {
  Ints<T> offset;      ///< of the base node in the arena
  Vec<Pack<T>, 3> fx;  ///< cells above it
};

/// `low`: lowest node of the owner block.
template <typename T>
GRAUPEL_LANES LanePlace<T> place_of(const CpuStep<T>& s, int64_t tile_index, int lane, const Ints<T> (&low)[3]) {
  LanePlace<T> place;
  Ints<T> inside[3];
  for (int d = 0; d < 3; ++d) {
    const Lanes<T> local = (component<T, 3>(s.position, tile_index, d, lane) - s.origin[d]) * s.inverse_dx;
    const AxisStencil<Pack<T>> axis = axis_stencil(Pack<T>(local), low[d], block_width - 1);
    inside[d] = axis.base;
    place.fx[d] = axis.fx;
  }
  place.offset = (inside[0] * arena_width<> + inside[1]) * row_stride + inside[2] * channels;
  return place;
}

}  // namespace
}  // namespace graupel::mpm
