// Transfers between particles and an arena (mpm/transfer.h). Weights and momenta of a tile's 16 particles are computed
// a lane a particle; then each particle takes its nine rows of three nodes, all channels of several nodes in one
// vector.
#pragma once

#include "mpm/grid.h"
#include "mpm/particles.h"
#include "mpm/simd/cpu_step.h"
#include "mpm/simd/lanes_matrix.h"

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
  place.offset = (inside[0] * arena_width + inside[1]) * row_stride + inside[2] * channels;
  return place;
}

template <typename T>
GRAUPEL_LANES void spline_weights(Lanes<T> fx, Lanes<T> (&w)[3]) {
  const Lanes<T> low = T(1.5) - fx, mid = fx - T(1), high = fx - T(0.5);
  w[0] = T(0.5) * low * low;
  w[1] = T(0.75) - mid * mid;
  w[2] = T(0.5) * high * high;
}

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
GRAUPEL_LANES Lanes<T> density_of(const CpuStep<T>& s, int64_t tile_index, int lane) {
  const int32_t* material = s.material + tile_index * tile_lanes + lane;
  const int32_t first = material[0];
  bool same = true;
  for (int l = 1; l < width<T>; ++l) same = same && material[l] == first;
  if (same) return splat(s.materials[first].density);
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
    Lanes<T> w[3][3];
    for (int d = 0; d < 3; ++d) spline_weights<T>(place.fx[d], w[d]);
    for (int r = 0; r < 9; ++r) store(out.weight[r] + lane, w[0][r / 3] * w[1][r % 3]);
    store_by_lane<T>(out.last_weight + 4 * lane, w[2][0], w[2][1], w[2][2], Lanes<T>{});
    const Lanes<T> volume = component<T, 1>(s.volume, tile_index, 0, lane);
    const Lanes<T> mass = density_of(s, tile_index, lane) * volume;
    const Lanes<T> affine = mass * s.dx, force = (T(-4) * s.dt * s.inverse_dx) * volume;
    Lanes<T> A[3][3], at_base[3];
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        A[r][c] = affine * component<T, 9>(s.affine_velocity, tile_index, 3 * r + c, lane) +
                  force * component<T, 6>(s.stress, tile_index, symmetric_entry(r, c), lane);
      at_base[r] = mass * component<T, 3>(s.velocity, tile_index, r, lane) -
                   (A[r][0] * place.fx[0] + A[r][1] * place.fx[1] + A[r][2] * place.fx[2]);
    }
    store_by_lane<T>(out.at_base + 4 * lane, at_base[0], at_base[1], at_base[2], mass);
    for (int c = 0; c < 3; ++c) store_by_lane<T>(out.change[c] + 4 * lane, A[0][c], A[1][c], A[2][c], Lanes<T>{});
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
      T* at = to + (x * arena_width + y) * row_stride;
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
  Lanes<T> w[3], moment[3];
  for (int d = 0; d < 3; ++d) {
    spline_weights<T>(place.fx[d], w);
    for (int k = 0; k < 3; ++k) moment[k] = w[k] * (T(k) - place.fx[d]);
    if (d < 2) {
      for (int k = 0; k < 3; ++k) {
        store(out.weight[d][k] + lane, w[k]);
        store(out.moment[d][k] + lane, moment[k]);
      }
    } else {
      store_by_lane<T>(out.last_weight + 4 * lane, w[0], w[1], w[2], Lanes<T>{});
      store_by_lane<T>(out.last_moment + 4 * lane, moment[0], moment[1], moment[2], Lanes<T>{});
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
      const Lanes<T> row = load(from + (x * arena_width + y) * (arena_row * channels));
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
