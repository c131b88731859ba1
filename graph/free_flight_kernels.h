// Kernels of graph/free_flight.cpp, for host and device.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>

#include "core/host_device.h"
#include "core/vec.h"
#include "sparsegrid/obstacle.h"

namespace graupel::graph::flight {

inline constexpr int32_t nobody = INT32_MAX;
inline constexpr double unit_of_way = 1 << 30, unit_of_acceleration = int64_t{1} << 34;  ///< of sums, per m
inline constexpr float least_inertia = 1e-9f;  ///< [m^2] per particle: less does not turn
inline constexpr float singular = 1e-5f;       ///< of the inertia's trace, added to its diagonal

GRAUPEL_HD inline void add_to(int64_t& sum, int64_t value) {
#ifdef __CUDA_ARCH__
  atomicAdd(reinterpret_cast<unsigned long long*>(&sum), static_cast<unsigned long long>(value));
#else
  std::atomic_ref<int64_t>(sum).fetch_add(value, std::memory_order_relaxed);
#endif
}
GRAUPEL_HD inline int32_t read(int32_t& place) {
#ifdef __CUDA_ARCH__
  return *static_cast<volatile int32_t*>(&place);
#else
  return std::atomic_ref<int32_t>(place).load(std::memory_order_relaxed);
#endif
}
GRAUPEL_HD inline void write(int32_t& place, int32_t value) {
#ifdef __CUDA_ARCH__
  *static_cast<volatile int32_t*>(&place) = value;
#else
  std::atomic_ref<int32_t>(place).store(value, std::memory_order_relaxed);
#endif
}
/// place = value if it was `expected`; returns what it was.
GRAUPEL_HD inline int32_t exchange_if(int32_t& place, int32_t expected, int32_t value) {
#ifdef __CUDA_ARCH__
  return atomicCAS(&place, expected, value);
#else
  std::atomic_ref<int32_t>(place).compare_exchange_strong(expected, value, std::memory_order_relaxed);
  return expected;
#endif
}
GRAUPEL_HD inline void lower_to(int32_t& place, int32_t value) {
#ifdef __CUDA_ARCH__
  atomicMin(&place, value);
#else
  int32_t seen = read(place);
  while (value < seen && !std::atomic_ref<int32_t>(place).compare_exchange_weak(seen, value, std::memory_order_relaxed))
    ;
#endif
}

/// Dense cells; particles beyond them count in the outermost ones.
struct Cells {
  Vec3f origin;  ///< [m]
  float inverse_spacing;
  Vec3i size;
  GRAUPEL_HD int64_t count() const { return int64_t{size[0]} * size[1] * size[2]; }
  GRAUPEL_HD int32_t of(const Vec3f& x) const {
    int32_t number = 0;
    for (int d = 2; d >= 0; --d) {
      const float u = (x[d] - origin[d]) * inverse_spacing, last = static_cast<float>(size[d] - 1);
      number = number * size[d] + static_cast<int32_t>(u > 0 ? (u < last ? u : last) : 0);  // NaN: 0
    }
    return number;
  }
};

/// What a group adds up, in its leader's place: about the leader's position x0, d = x - x0, of masses relative to the
/// largest. a is the acceleration less gravity's.
struct GroupSums {
  int64_t mass, way[3];       ///< sum m, sum m d
  int64_t square[6];          ///< sum m d d^T: xx yy zz xy yz zx
  int64_t push[3], twist[3];  ///< sum m a, sum m d x a
  int32_t touches;
};

/// The frame at hand and its groups: a union-find over cells, whose roots are their groups' lowest cells.
struct Groups {
  Cells cells;
  Vec3f gravity;        ///< [m/frame^2]
  int32_t* parent;      ///< [cells] -1 between frames and where nobody is
  int32_t* leader;      ///< [cells] its first particle; `nobody` between frames
  int32_t* group;       ///< [n] leader of the group
  GroupSums* sums;      ///< [n]
  const float* mass;    ///< [n] of the largest
  const Vec3f* before;  ///< [n] [m]
  const Vec3f* now;

  GRAUPEL_HD Vec3f ballistic(int64_t i) const { return now[i] + (now[i] - before[i]) + gravity; }
  GRAUPEL_HD int32_t root(int32_t cell) const {
    for (int32_t up = read(parent[cell]); up != cell; up = read(parent[cell])) cell = up;
    return cell;
  }
  GRAUPEL_HD void unite(int32_t a, int32_t b) const {
    for (;;) {
      a = root(a);
      b = root(b);
      if (a == b) return;
      const int32_t low = a < b ? a : b, high = a < b ? b : a;
      if (exchange_if(parent[high], high, low) == high) return;
    }
  }
};

struct MarkCells {
  Groups groups;
  GRAUPEL_HD void operator()(int64_t i) const {
    groups.sums[i] = {};
    for (const int32_t cell : {groups.cells.of(groups.now[i]), groups.cells.of(groups.ballistic(i))}) {
      write(groups.parent[cell], cell);
      if (read(groups.leader[cell]) > i) lower_to(groups.leader[cell], static_cast<int32_t>(i));
    }
  }
};

struct JoinCells {
  Groups groups;
  /// With the 13 neighbours of higher number; the leader does it for its cell.
  GRAUPEL_HD void join(int32_t cell) const {
    const Vec3i size = groups.cells.size;
    const Vec3i at = {cell % size[0], cell / size[0] % size[1], cell / size[0] / size[1]};
    for (int k = 14; k < 27; ++k) {
      const Vec3i other = {at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1};
      bool inside = true;
      for (int d = 0; d < 3; ++d) inside = inside && other[d] >= 0 && other[d] < size[d];
      if (!inside) continue;
      const int32_t number = (other[2] * size[1] + other[1]) * size[0] + other[0];
      if (read(groups.parent[number]) >= 0) groups.unite(cell, number);
    }
  }
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t here = groups.cells.of(groups.now[i]), there = groups.cells.of(groups.ballistic(i));
    if (here != there) groups.unite(here, there);
    if (groups.leader[here] == i) join(here);
    if (here != there && groups.leader[there] == i) join(there);
  }
};

/// Finds the groups, and those that touch a wall.
struct FindGroup {
  Groups groups;
  Vec3f low, high;  ///< [m] the walls, less the reach of contact
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t group = groups.leader[groups.root(groups.cells.of(groups.now[i]))];
    groups.group[i] = group;
    bool touches = false;
    for (const Vec3f& x : {groups.now[i], groups.ballistic(i)})
      for (int d = 0; d < 3; ++d) touches = touches || !(x[d] > low[d] && x[d] < high[d]);
    if (touches) write(groups.sums[group].touches, 1);
  }
};

/// Of groups that touch no wall: those that touch an obstacle.
struct FindContact {
  Groups groups;
  sparsegrid::ObstacleSetView obstacles;
  float reach;  ///< [m]
  GRAUPEL_HD void operator()(int64_t i) const {
    GroupSums& sums = groups.sums[groups.group[i]];
    if (read(sums.touches) != 0) return;
    int nearest = -1;
    const float clearance =
        signed_distance(obstacles, groups.now[i], nearest).phi / static_cast<float>(sparsegrid::steepest_grid);
    const float way = norm(groups.ballistic(i) - groups.now[i]);
    if (nearest >= 0 && !(clearance > reach + way)) write(sums.touches, 1);
  }
};

struct SumPlaces {
  Groups groups;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t group = groups.group[i];
    GroupSums& sums = groups.sums[group];
    if (sums.touches != 0) return;
    const double mass = groups.mass[i] * unit_of_way;
    const Vec3d d = (groups.now[i] - groups.now[group]).cast<double>();
    add_to(sums.mass, llrint(mass));
    for (int k = 0; k < 3; ++k) {
      add_to(sums.way[k], llrint(mass * d[k]));
      add_to(sums.square[k], llrint(mass * d[k] * d[k]));
      add_to(sums.square[3 + k], llrint(mass * d[k] * d[(k + 1) % 3]));
    }
  }
};

struct SumPushes {
  Groups groups;
  const Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t group = groups.group[i];
    GroupSums& sums = groups.sums[group];
    if (sums.touches != 0) return;
    const double mass = groups.mass[i] * unit_of_acceleration;
    const Vec3d d = (groups.now[i] - groups.now[group]).cast<double>();
    const Vec3d a = (next[i] - groups.ballistic(i)).cast<double>(), twist = cross(d, a);
    for (int k = 0; k < 3; ++k) {
      add_to(sums.push[k], llrint(mass * a[k]));
      add_to(sums.twist[k], llrint(mass * twist[k]));
    }
  }
};

/// Solves m x = b for a symmetric m: xx yy zz xy yz zx.
GRAUPEL_HD inline Vec3d solve(const double (&m)[6], const Vec3d& b) {
  const Vec3d x = {m[0], m[3], m[5]}, y = {m[3], m[1], m[4]}, z = {m[5], m[4], m[2]};
  const Vec3d yz = cross(y, z);
  return (yz * b[0] + cross(z, x) * b[1] + cross(x, y) * b[2]) * (1 / dot(x, yz));
}

struct Correct {
  Groups groups;
  Vec3f* next;
  GRAUPEL_HD void operator()(int64_t i) const {
    const int32_t group = groups.group[i];
    const GroupSums& sums = groups.sums[group];
    if (sums.touches != 0) return;
    const double mass = static_cast<double>(sums.mass) / unit_of_way;
    Vec3d centre, push, twist;  // about the leader
    double square[6];
    for (int k = 0; k < 3; ++k) {
      centre[k] = static_cast<double>(sums.way[k]) / unit_of_way / mass;
      push[k] = static_cast<double>(sums.push[k]) / unit_of_acceleration / mass;
      twist[k] = static_cast<double>(sums.twist[k]) / unit_of_acceleration / mass;
    }
    for (int k = 0; k < 6; ++k)
      square[k] =
          static_cast<double>(sums.square[k]) / unit_of_way / mass - centre[k % 3] * centre[k < 3 ? k : (k + 1) % 3];
    const double trace = square[0] + square[1] + square[2];
    Vec3d change = push;
    if (trace > least_inertia) {
      const double spare = singular * trace;
      const double inertia[6] = {trace - square[0] + spare,
                                 trace - square[1] + spare,
                                 trace - square[2] + spare,
                                 -square[3],
                                 -square[4],
                                 -square[5]};
      const Vec3d turn = solve(inertia, twist - cross(centre, push));
      change += cross(turn, (groups.now[i] - groups.now[group]).cast<double>() - centre);
    }
    next[i] = next[i] - change.cast<float>();
  }
};

/// As it was before the frame.
struct ClearCells {
  Groups groups;
  GRAUPEL_HD void operator()(int64_t i) const {
    for (const int32_t cell : {groups.cells.of(groups.now[i]), groups.cells.of(groups.ballistic(i))}) {
      write(groups.parent[cell], -1);
      write(groups.leader[cell], nobody);
    }
  }
};

}  // namespace graupel::graph::flight
