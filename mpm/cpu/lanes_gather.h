// G2P of 16 particles: weights a lane a particle, then each particle's nine rows of three nodes, all channels of
// several nodes in one vector. Equals mpm/phases/grid_to_particle.cpp. Gain, with all that follows in the same pass:
// water 54 -> 22, sand 126 -> 36 ns a particle (docs/decisions/0006-cpu-tuning.md).
#pragma once

#include "mpm/cpu/lanes_place.h"
#include "mpm/cpu/lanes_shuffle.h"

namespace graupel::mpm {
namespace {

/// Weights of 16 particles for gather_one(): w, and w times the node's distance from the particle.
template <typename T>
struct GatherTile {
  alignas(64) T weight[2][3][tile_lanes], moment[2][3][tile_lanes];        ///< along the first two axes
  alignas(64) T last_weight[4 * tile_lanes], last_moment[4 * tile_lanes];  ///< along the last; by particle
  alignas(64) int32_t offset[tile_lanes];
  /// Results, by particle: velocity, and columns 0..2 of C over 4/dx.
  alignas(64) T velocity[4 * tile_lanes], column[3][4 * tile_lanes];
};

template <typename T>
GRAUPEL_LANES void prepare_gather(const CpuStep<T>& s, int64_t tile_index, int lane, const Ints<T> (&low)[3],
                                  GatherTile<T>& out) {
  const LanePlace<T> place = place_of(s, tile_index, lane, low);
  store(out.offset + lane, place.offset);
  for (int d = 0; d < 3; ++d) {
    const auto [w] = bspline_weights(place.fx[d]);
    Pack<T> moment[3];
    for (int k = 0; k < 3; ++k) moment[k] = w[k] * (T(k) - place.fx[d]);
    if (d < 2) {
      for (int k = 0; k < 3; ++k) {
        store(out.weight[d][k] + lane, w[k].v);
        store(out.moment[d][k] + lane, moment[k].v);
      }
    } else {
      store_by_lane<T>(out.last_weight + 4 * lane, w[0].v, w[1].v, w[2].v, Lanes<T>{});
      store_by_lane<T>(out.last_moment + 4 * lane, moment[0].v, moment[1].v, moment[2].v, Lanes<T>{});
    }
  }
}

/// Sums over x and y of one part of the rows: velocity, its moments in x and y.
template <typename T, int part>
GRAUPEL_LANES void gather_part(GatherTile<T>& t, int l, const T* arena, Node<T> (&sums)[4]) {
  const T* from = arena + t.offset[l] + part * width<T>;
  Lanes<T> sum = Lanes<T>{}, moment_x = Lanes<T>{}, moment_y = Lanes<T>{};
#pragma GCC unroll 3
  for (int x = 0; x < 3; ++x) {
    Lanes<T> v = Lanes<T>{}, moment = Lanes<T>{};
#pragma GCC unroll 3
    for (int y = 0; y < 3; ++y) {
      const Lanes<T> row = load(from + (x * arena_width<> + y) * (arena_row * channels));
      v += t.weight[1][y][l] * row;
      moment += t.moment[1][y][l] * row;
    }
    sum += t.weight[0][x][l] * v;
    moment_x += t.moment[0][x][l] * v;
    moment_y += t.weight[0][x][l] * moment;
  }
  const Lanes<T> along = stairs<T, part>(load_as<Node<T>>(t.last_weight + 4 * l));
  const Lanes<T> moment_along = stairs<T, part>(load_as<Node<T>>(t.last_moment + 4 * l));
  sums[0] += sum_of_nodes<T>(along * sum);
  sums[1] += sum_of_nodes<T>(along * moment_x);
  sums[2] += sum_of_nodes<T>(along * moment_y);
  sums[3] += sum_of_nodes<T>(moment_along * sum);
}

/// Velocity of particle l and its gradient, by particle.
template <typename T>
GRAUPEL_LANES void gather_one(GatherTile<T>& t, int l, const T* arena) {
  Node<T> sums[4] = {};
  gather_part<T, 0>(t, l, arena, sums);
  constexpr int parts = row_parts<T>;
  if constexpr (parts > 1) gather_part<T, 1>(t, l, arena, sums);
  if constexpr (parts > 2) gather_part<T, 2>(t, l, arena, sums);
  store(t.velocity + 4 * l, sums[0]);
  for (int d = 0; d < 3; ++d) store(t.column[d] + 4 * l, sums[d + 1]);
}

}  // namespace
}  // namespace graupel::mpm
