// Definitions of the look-ups of obstacle.h: trilinear interpolation of a NanoVDB level set and its exact gradient.
#pragma once

#include <cmath>

#include "sparsegrid/obstacle.h"

namespace graupel::sparsegrid {

namespace lookup {

/// low <= x <= high; false for NaN.
template <typename T>
GRAUPEL_HD bool in_box(const Vec<T, 3>& x, const Vec<T, 3>& low, const Vec<T, 3>& high) {
  return x[0] >= low[0] && x[0] <= high[0] && x[1] >= low[1] && x[1] <= high[1] && x[2] >= low[2] && x[2] <= high[2];
}

template <typename T>
GRAUPEL_HD Vec<T, 3> to_local(const ObstacleFrame<T>& frame, const Vec<T, 3>& x) {
  const Vec<T, 3> v = x - frame.position;
  Vec<T, 3> local;
  for (int i = 0; i < 3; ++i)
    local[i] = frame.rotation.a[0][i] * v[0] + frame.rotation.a[1][i] * v[1] + frame.rotation.a[2][i] * v[2];
  return local;
}

/// Trilinear interpolant of eight corner values, v[i][j][k] at offset (i, j, k), and its gradient.
template <typename T>
GRAUPEL_HD T trilinear(const T (&v)[2][2][2], const Vec<T, 3>& t, Vec<T, 3>& gradient) {
  T line[2][2], slope_z[2][2];
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      slope_z[i][j] = v[i][j][1] - v[i][j][0];
      line[i][j] = v[i][j][0] + t[2] * slope_z[i][j];
    }
  T plane[2], plane_z[2], slope_y[2];
  for (int i = 0; i < 2; ++i) {
    slope_y[i] = line[i][1] - line[i][0];
    plane[i] = line[i][0] + t[1] * slope_y[i];
    plane_z[i] = slope_z[i][0] + t[1] * (slope_z[i][1] - slope_z[i][0]);
  }
  gradient = {plane[1] - plane[0], slope_y[0] + t[0] * (slope_y[1] - slope_y[0]),
              plane_z[0] + t[0] * (plane_z[1] - plane_z[0])};
  return plane[0] + t[0] * gradient[0];
}

GRAUPEL_HD inline nanovdb::Coord to_coord(const Vec<int, 3>& v) { return nanovdb::Coord(v[0], v[1], v[2]); }

template <typename T>
GRAUPEL_HD Vec<int, 3> floor_of(const Vec<T, 3>& index) {
  return {static_cast<int>(std::floor(index[0])), static_cast<int>(std::floor(index[1])),
          static_cast<int>(std::floor(index[2]))};
}

/// Place of the voxel `at` among the dense values, or -1 where `margin` voxels above it are not all among them.
GRAUPEL_HD inline int64_t dense_place(const DenseValues& dense, const Vec<int, 3>& at, int margin) {
  if (dense.values == nullptr) return -1;
  int64_t place = 0;
  for (int d = 0; d < 3; ++d) {
    const int offset = at[d] - dense.low[d];
    if (offset < 0 || offset + margin >= dense.size[d]) return -1;
    place = place * dense.size[d] + offset;
  }
  return place;
}

/// The value at one voxel.
GRAUPEL_HD inline float value_at(const ObstacleView& obstacle, const Vec<int, 3>& at) {
  const int64_t place = dense_place(obstacle.dense, at, 0);
  return place >= 0 ? obstacle.dense.values[place] : obstacle.grid->tree().getValue(to_coord(at));
}

/// The eight grid values at base + {0, 1}^3; most often they lie in one leaf.
template <typename T>
GRAUPEL_HD void read_corners(const ObstacleView& obstacle, const Vec<int, 3>& base, T (&v)[2][2][2]) {
  const int64_t place = dense_place(obstacle.dense, base, 1);
  if (place >= 0) {
    const int64_t row = obstacle.dense.size[2], plane = row * obstacle.dense.size[1];
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        for (int k = 0; k < 2; ++k) v[i][j][k] = static_cast<T>(obstacle.dense.values[place + i * plane + j * row + k]);
    return;
  }
  const auto accessor = obstacle.grid->getAccessor();
  const nanovdb::Coord first = to_coord(base);
  const auto* leaf = accessor.probeLeaf(first);
  const bool in_one_leaf = leaf != nullptr && (base[0] & 7) != 7 && (base[1] & 7) != 7 && (base[2] & 7) != 7;
  const uint32_t offset = in_one_leaf ? leaf->CoordToOffset(first) : 0;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 2; ++k)
        v[i][j][k] = static_cast<T>(in_one_leaf ? leaf->getValue(offset + static_cast<uint32_t>(64 * i + 8 * j + k))
                                                : accessor.getValue(first.offsetBy(i, j, k)));
}

/// Value and gradient (in index space) at `index`, in voxels.
template <typename T>
GRAUPEL_HD T interpolate(const ObstacleView& obstacle, const Vec<T, 3>& index, Vec<T, 3>& gradient) {
  const Vec<int, 3> base = floor_of(index);
  T v[2][2][2];
  read_corners(obstacle, base, v);
  return trilinear(v, index - base.template cast<T>(), gradient);
}

}  // namespace lookup

template <typename T>
GRAUPEL_HD SignedDistance<T> signed_distance(const ObstacleView& obstacle, const Vec<T, 3>& x) {
  const ObstacleFrame<T>& frame = obstacle.template frame<T>();
  if (!lookup::in_box(x, frame.low, frame.high)) return {frame.band, Vec<T, 3>::zero()};
  const Vec<T, 3> local = lookup::to_local(frame, x);
  T phi;
  Vec<T, 3> gradient;
  if (obstacle.is_plane) {
    phi = local[1];
    gradient = {T(0), T(1), T(0)};
  } else {
    phi = lookup::interpolate(obstacle, local * frame.inverse_voxel, gradient);
  }
  if (phi >= frame.band) return {frame.band, Vec<T, 3>::zero()};
  if (phi <= -frame.band) return {-frame.band, Vec<T, 3>::zero()};
  return {phi, normalized(frame.rotation * gradient)};
}

template <typename T>
GRAUPEL_HD SignedDistance<T> signed_distance(const ObstacleSetView& set, const Vec<T, 3>& x, int& nearest) {
  nearest = -1;
  SignedDistance<T> best = {static_cast<T>(no_obstacle_distance), Vec<T, 3>::zero()};
  if (set.count == 0) return best;
  const T band = set.obstacles[0].template frame<T>().band;
  best.phi = band;
  set.near(x).for_each([&](int32_t i) {
    const ObstacleFrame<T>& frame = set.obstacles[i].template frame<T>();
    if (!lookup::in_box(x, frame.low, frame.high)) return;
    const SignedDistance<T> one = signed_distance(set.obstacles[i], x);
    if (one.phi >= best.phi) return;
    best = one;
    nearest = one.phi < band ? i : -1;
  });
  return best;
}

}  // namespace graupel::sparsegrid
