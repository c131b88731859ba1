// P2G of 16 particles: weights and momenta a lane a particle, then each particle's nine rows of three nodes, all
// channels of several nodes in one vector. Equals mpm/phases/particle_to_grid.cpp. Gain: water 27.6 -> 20.5, sand 28.6
// -> 18.3 ns a particle (docs/decisions/0006-cpu-tuning.md).
#pragma once

#include "mpm/cpu/lanes_place.h"
#include "mpm/cpu/lanes_shuffle.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm {
namespace {

/// What 16 particles add to an arena, ready for scatter_one().
template <typename T>
struct ScatterTile {
  alignas(64) T weight[9][tile_lanes];        ///< of the rows
  alignas(64) T last_weight[4 * tile_lanes];  ///< along a row; by particle
  alignas(64) T at_base[4 * tile_lanes];      ///< momentum and mass there; by particle
  alignas(64) T change[3][4 * tile_lanes];    ///< from node to node along each axis; by particle
  alignas(64) int32_t offset[tile_lanes];     ///< of the base node in the arena
};

template <typename T>
GRAUPEL_LANES Pack<T> density_of(const CpuStep<T>& s, int64_t tile_index, int lane) {
  const int32_t* material = s.material + tile_index * tile_lanes + lane;
  const int32_t first = material[0];
  bool same = true;
  for (int l = 1; l < width<T>; ++l) same = same && material[l] == first;
  if (same) return Pack<T>(s.materials[first].density);
  Lanes<T> density = Lanes<T>{};
  for (int l = 0; l < width<T>; ++l) density[l] = s.materials[material[l]].density;
  return density;
}

template <typename T>
GRAUPEL_LANES void prepare_scatter(const CpuStep<T>& s, int64_t tile_index, const Ints<T> (&low)[3],
                                   ScatterTile<T>& out) {
  for (int lane = 0; lane < tile_lanes; lane += width<T>) {
    const LanePlace<T> place = place_of(s, tile_index, lane, low);
    store(out.offset + lane, place.offset);
    AxisWeights<Pack<T>> w[3];
    for (int d = 0; d < 3; ++d) w[d] = bspline_weights(place.fx[d]);
    for (int r = 0; r < 9; ++r) store(out.weight[r] + lane, (w[0].w[r / 3] * w[1].w[r % 3]).v);
    store_by_lane<T>(out.last_weight + 4 * lane, w[2].w[0].v, w[2].w[1].v, w[2].w[2].v, Lanes<T>{});
    const Pack<T> volume = component<T, 1>(s.volume, tile_index, 0, lane);
    const Pack<T> mass = density_of(s, tile_index, lane) * volume;
    Mat<Pack<T>, 3> C, tau;
    for (int k = 0; k < 9; ++k) {
      C(k / 3, k % 3) = component<T, 9>(s.affine_velocity, tile_index, k, lane);
      tau(k / 3, k % 3) = component<T, 6>(s.stress, tile_index, symmetric_entry(k / 3, k % 3), lane);
    }
    const Mat<Pack<T>, 3> A = affine_momentum(mass, volume, s.dt, s.dx, s.inverse_dx, C, tau);
    Lanes<T> at_base[3];
    for (int r = 0; r < 3; ++r)  // lanes take their products in the order in which they stand (mpm/cpu/pack.h)
      at_base[r] = mass.v * component<T, 3>(s.velocity, tile_index, r, lane) -
                   (A(r, 0).v * place.fx[0].v + A(r, 1).v * place.fx[1].v + A(r, 2).v * place.fx[2].v);
    store_by_lane<T>(out.at_base + 4 * lane, at_base[0], at_base[1], at_base[2], mass.v);
    for (int c = 0; c < 3; ++c) store_by_lane<T>(out.change[c] + 4 * lane, A(0, c).v, A(1, c).v, A(2, c).v, Lanes<T>{});
  }
}

/// The four numbers of particle l, repeated.
template <typename T>
GRAUPEL_LANES Lanes<T> four_channels(const T* by_particle, int l) {
  return repeated<T>(load_as<Node<T>>(by_particle + 4 * l));
}

template <typename T, int part>
GRAUPEL_LANES void scatter_part(const ScatterTile<T>& t, int l, T* arena) {
  const Node<T> steps = {T(0), T(1), T(2), T(0)};
  const Lanes<T> along = stairs<T, part>(load_as<Node<T>>(t.last_weight + 4 * l));
  Lanes<T> row_x = along * (four_channels(t.at_base, l) + stairs<T, part>(steps) * four_channels(t.change[2], l));
  const Lanes<T> change_x = along * four_channels(t.change[0], l), change_y = along * four_channels(t.change[1], l);
  T* to = arena + t.offset[l] + part * width<T>;
#pragma GCC unroll 3
  for (int x = 0; x < 3; ++x) {
    Lanes<T> row = row_x;
#pragma GCC unroll 3
    for (int y = 0; y < 3; ++y) {
      T* at = to + (x * arena_width<> + y) * row_stride;
      store(at, load(at) + t.weight[3 * x + y][l] * row);
      row += change_y;
    }
    row_x += change_x;
  }
}

/// Adds particle l of the tile to an arena.
template <typename T>
GRAUPEL_LANES void scatter_one(const ScatterTile<T>& t, int l, T* arena) {
  constexpr int parts = row_parts<T>;
  scatter_part<T, 0>(t, l, arena);
  if constexpr (parts > 1) scatter_part<T, 1>(t, l, arena);
  if constexpr (parts > 2) scatter_part<T, 2>(t, l, arena);
}

}  // namespace
}  // namespace graupel::mpm
