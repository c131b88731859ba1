// Kernels of graph/corrections/free_flight.cpp and graph/cuda/corrections/free_flight_launch.cu, for host and device.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>

#include "graph/corrections/flight_cells.h"
#include "sparsegrid/obstacle.h"

namespace graupel::graph::flight {

inline constexpr int32_t nobody = INT32_MAX, ground = 0;
inline constexpr int times = 2;        ///< now, and after a frame of ballistic flight
inline constexpr int directions = 13;  ///< to neighbours of lower number, the lowest first
inline constexpr double unit_of_way = 1 << 30, unit_of_acceleration = int64_t{1} << 34;  ///< of sums, per m
inline constexpr float least_inertia = 1e-9f;  ///< [m^2] per particle: less does not turn
inline constexpr float singular = 1e-5f;       ///< of the inertia's trace, added to its diagonal

// What several threads share. Orders do not matter: each kernel reads what the one before has written, but for the
// union-find's parents, which only ever go from one ancestor to a higher one.

template <typename T>
GRAUPEL_HD T read(const T& place) {
#ifdef __CUDA_ARCH__
  return *static_cast<const volatile T*>(&place);
#else
  return std::atomic_ref<T>(const_cast<T&>(place)).load(std::memory_order_relaxed);
#endif
}
GRAUPEL_HD inline void write(int32_t& place, int32_t value) {
#ifdef __CUDA_ARCH__
  *static_cast<volatile int32_t*>(&place) = value;
#else
  std::atomic_ref<int32_t>(place).store(value, std::memory_order_relaxed);
#endif
}
GRAUPEL_HD inline void add_to(int64_t& sum, int64_t value) {
#ifdef __CUDA_ARCH__
  atomicAdd(reinterpret_cast<unsigned long long*>(&sum), static_cast<unsigned long long>(value));
#else
  std::atomic_ref<int64_t>(sum).fetch_add(value, std::memory_order_relaxed);
#endif
}
GRAUPEL_HD inline void add_bit(uint64_t& bits, uint64_t bit) {
#ifdef __CUDA_ARCH__
  atomicOr(reinterpret_cast<unsigned long long*>(&bits), static_cast<unsigned long long>(bit));
#else
  std::atomic_ref<uint64_t>(bits).fetch_or(bit, std::memory_order_relaxed);
#endif
}
/// Adds 1; returns what it was.
GRAUPEL_HD inline int32_t count_up(int32_t& count) {
#ifdef __CUDA_ARCH__
  return atomicAdd(&count, 1);
#else
  return std::atomic_ref<int32_t>(count).fetch_add(1, std::memory_order_relaxed);
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
/// place = the lesser of it and value; returns what it was.
GRAUPEL_HD inline int32_t lower_to(int32_t& place, int32_t value) {
#ifdef __CUDA_ARCH__
  return atomicMin(&place, value);
#else
  int32_t seen = read(place);
  while (value < seen && !std::atomic_ref<int32_t>(place).compare_exchange_weak(seen, value, std::memory_order_relaxed))
    ;
  return seen;
#endif
}

template <int N>
struct Terms {
  static constexpr int size = N;
  int64_t value[N];
};
using PlaceTerms = Terms<10>;  ///< m, m d, m d d^T: xx yy zz xy yz zx
using PushTerms = Terms<6>;    ///< m a, m d x a

/// What a group adds up about the centre x0 of its lowest cell: d = x - x0, masses m relative to the largest, a the
/// acceleration less gravity's.
struct GroupMomentum {
  PlaceTerms place;
  PushTerms push;
  int32_t touches;
  int32_t spans_period;  ///< so far that a place of its spin is ambiguous
};

/// What a group's accelerations change by: push + spin x (x - centre).
struct GroupChange {
  Vec3d push, spin, centre;
};

/// The frame at hand and its groups: a union-find over nodes, which are the cells now and, behind them, the cells after
/// the frame. A group's root is its lowest node, a cell of now; what touches a wall hangs on the node `ground`, a
/// corner of the cells outside the walls.
struct Groups {
  FlightCells cells;
  Vec3f gravity;            ///< [m/frame^2]
  Vec3f low, high;          ///< [m] the walls, less the contact distance
  float contact_distance;   ///< [m] nearer obstacles and walls are touched
  Vec3f period;             ///< [m] of axes with periodic walls; 0 of others
  Vec3f box_low, box_high;  ///< [m] where those walls are
  sparsegrid::ObstacleSetView obstacles;
  int64_t n;
  uint64_t* matter;     ///< [nodes] fine cells with particles; 0 between frames
  int32_t* parent;      ///< [nodes] `nobody` between frames and where nobody is; `ground` of the ground
  int32_t* slot;        ///< [cells] of now: place among those with particles
  int32_t* list;        ///< [times, n] nodes with particles, in any order
  int32_t* listed;      ///< [times] how many; 0 between frames
  int32_t* finished;    ///< blocks of a GPU that are done; 0 between frames
  int32_t* group;       ///< [n] slot of the group's root; -1 what touches a wall
  int32_t* origin;      ///< [n] cell of a slot
  GroupMomentum* sums;  ///< [n] of a slot
  const float* mass;    ///< [n] of the largest
  const Vec3f* before;  ///< [n] [m]
  const Vec3f* current;

  GRAUPEL_HD Vec3f ballistic(int64_t i) const { return current[i] + (current[i] - before[i]) + gravity; }
  GRAUPEL_HD bool is_inside(const Vec3f& x) const {
    bool inside = true;
    for (int d = 0; d < 3; ++d) inside = inside && x[d] > low[d] && x[d] < high[d];
    return inside;
  }
  /// Across a periodic wall: in the box.
  GRAUPEL_HD Vec3f wrapped(Vec3f x) const {
    for (int d = 0; d < 3; ++d) {
      if (!(period[d] > 0)) continue;
      if (x[d] < box_low[d]) x[d] += period[d];
      if (x[d] > box_high[d]) x[d] -= period[d];
    }
    return x;
  }
  GRAUPEL_HD int64_t nodes() const { return times * cells.count(); }
  GRAUPEL_HD int32_t first_node(int time) const { return time * static_cast<int32_t>(cells.count()); }

  GRAUPEL_HD int32_t node_of(int time, int64_t i) const {
    return first_node(time) + cells.of(time == 0 ? current[i] : wrapped(ballistic(i))).cell;
  }

  /// With path halving (as ECL-CC, Jaiganesh and Burtscher 2018): it is written to nodes that are no roots alone.
  GRAUPEL_HD int32_t root(int32_t node) const {
    int32_t up = read(parent[node]);
    while (up != node) {
      const int32_t above = read(parent[up]);
      if (above != up) write(parent[node], above);
      node = up;
      up = above;
    }
    return node;
  }
  GRAUPEL_HD void unite(int32_t a, int32_t b) const {
    for (;;) {
      a = root(a);
      b = root(b);
      if (a == b) return;
      const int32_t low_root = a < b ? a : b, high_root = a < b ? b : a;
      if (exchange_if(parent[high_root], high_root, low_root) == high_root) return;
    }
  }

  /// Whether an obstacle is within the contact distance, now or on the way of this frame.
  GRAUPEL_HD bool touches_obstacle(int64_t i) const {
    int nearest = -1;
    const float phi = signed_distance(obstacles, current[i], nearest).phi;
    const float way = norm(ballistic(i) - current[i]);
    return nearest >= 0 && !(phi > (contact_distance + way) * static_cast<float>(sparsegrid::steepest_grid));
  }

  GRAUPEL_HD Vec3d from_origin(int64_t i, int32_t slot_of_group) const {
    Vec3d d = (current[i] - cells.centre(origin[slot_of_group])).cast<double>();
    for (int k = 0; k < 3; ++k) {
      const double length = static_cast<double>(period[k]);
      if (length > 0) d[k] += d[k] > length / 2 ? -length : d[k] < -length / 2 ? length : 0;
    }
    return d;
  }
  /// Whether the nearest image of particle i is nearly as far as the next one.
  GRAUPEL_HD bool is_ambiguous(int64_t i, int32_t slot_of_group) const {
    constexpr double most = 0.4;
    bool ambiguous = false;
    for (int k = 0; k < 3; ++k)
      ambiguous = ambiguous || (period[k] > 0 && std::abs(from_origin(i, slot_of_group)[k]) > most * period[k]);
    return ambiguous;
  }
  GRAUPEL_HD PlaceTerms place_terms(int64_t i, int32_t slot_of_group) const {
    const double m = mass[i] * unit_of_way;
    const Vec3d d = from_origin(i, slot_of_group);
    PlaceTerms terms;
    terms.value[0] = llrint(m);
    for (int k = 0; k < 3; ++k) {
      terms.value[1 + k] = llrint(m * d[k]);
      terms.value[4 + k] = llrint(m * d[k] * d[k]);
      terms.value[7 + k] = llrint(m * d[k] * d[(k + 1) % 3]);
    }
    return terms;
  }
  GRAUPEL_HD PushTerms push_terms(int64_t i, int32_t slot_of_group, const Vec3f* next) const {
    const double m = mass[i] * unit_of_acceleration;
    const Vec3d a = (next[i] - ballistic(i)).cast<double>(), twist = cross(from_origin(i, slot_of_group), a);
    PushTerms terms;
    for (int k = 0; k < 3; ++k) {
      terms.value[k] = llrint(m * a[k]);
      terms.value[3 + k] = llrint(m * twist[k]);
    }
    return terms;
  }
  GRAUPEL_HD bool flies(int32_t slot_of_group) const { return slot_of_group >= 0 && sums[slot_of_group].touches == 0; }
};

template <int N>
GRAUPEL_HD void add_terms(Terms<N>& sum, const Terms<N>& terms) {
  for (int k = 0; k < N; ++k) add_to(sum.value[k], terms.value[k]);
}

/// Item i: node i as it is between frames, and the counters.
struct ClearAll {
  Groups groups;
  GRAUPEL_HD void operator()(int64_t i) const {
    groups.matter[i] = 0;
    groups.parent[i] = i == ground ? ground : nobody;
    if (i != 0) return;
    for (int time = 0; time < times; ++time) groups.listed[time] = 0;
    *groups.finished = 0;
  }
};

/// Item i: marks the cells of particle i at both times, each of which hangs on itself or on the ground.
struct MarkCells {
  Groups groups;
  GRAUPEL_HD void mark(int time, const FineCell& at, bool touches) const {
    const int32_t node = groups.first_node(time) + at.cell, parent = touches ? ground : node;
    if (node == ground) return;
    if ((read(groups.matter[node]) & at.bit) == 0) add_bit(groups.matter[node], at.bit);
    if (read(groups.parent[node]) <= parent || lower_to(groups.parent[node], parent) != nobody) return;
    const int32_t slot = count_up(groups.listed[time]);
    groups.list[time * groups.n + slot] = node;
    if (time != 0) return;
    groups.slot[at.cell] = slot;
    groups.origin[slot] = at.cell;
    groups.sums[slot] = {};
  }
  GRAUPEL_HD void operator()(int64_t i) const {
    const Vec3f current = groups.current[i], then = groups.ballistic(i);
    const bool touches = !groups.is_inside(current) || !groups.is_inside(then);
    mark(0, groups.cells.of(current), touches);
    mark(1, groups.cells.of(groups.wrapped(then)), touches);
  }
};

GRAUPEL_HD inline Vec3i step_of(int direction) { return {direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1}; }

/// The direction of the lower neighbour along an axis.
GRAUPEL_HD constexpr int face_direction(int axis) { return axis == 0 ? 12 : axis == 1 ? 10 : 4; }

/// Whether a node is near to its neighbour at `step` by way of one of the `faces`, the matter of its lower neighbours
/// along the axes: then its own join is spare. Joins across faces are never spare, those with fewer axes come
/// first, so all is joined in the end.
GRAUPEL_HD inline bool is_spare(const Vec3i& step, uint64_t matter, const uint64_t (&faces)[3], uint64_t others) {
  for (int d = 0; d < 3; ++d) {
    Vec3i face = {0, 0, 0}, rest = step;
    face[d] = -1;
    rest[d] = 0;
    if (step[d] == -1 && !(rest == Vec3i{0, 0, 0}) && any_near(matter, faces[d], face) &&
        any_near(faces[d], others, rest))
      return true;
  }
  return false;
}

/// A neighbour of a node, -1 outside the cells, and where it has matter.
struct Neighbor {
  int32_t node;
  uint64_t matter;
};
GRAUPEL_HD inline Neighbor neighbor_of(const Groups& groups, int time, int32_t node, const Vec3i& step) {
  const int32_t first = groups.first_node(time);
  const int32_t cell = groups.cells.beside(groups.cells.at(node - first), step);
  return {cell < 0 ? -1 : first + cell, cell < 0 ? 0 : groups.matter[first + cell]};
}

/// Finds the group of particle i, and whether it touches an obstacle. Returns the group's slot where it may fly.
GRAUPEL_HD inline int32_t place_particle(const Groups& groups, int64_t i) {
  const int32_t root = groups.root(groups.node_of(0, i));
  const int32_t slot = root == ground ? -1 : groups.slot[root];
  groups.group[i] = slot;
  if (slot < 0 || read(groups.sums[slot].touches) != 0) return -1;
  if (groups.is_ambiguous(i, slot)) write(groups.sums[slot].spans_period, 1);
  if (!groups.touches_obstacle(i)) return slot;
  write(groups.sums[slot].touches, 1);
  return -1;
}

/// Item k of a time's list: as it was before the frame.
struct ClearNode {
  Groups groups;
  GRAUPEL_HD void clear(int time, int64_t k) const {
    const int32_t node = groups.list[time * groups.n + k];
    groups.matter[node] = 0;
    groups.parent[node] = nobody;
  }
};

/// Solves m x = b for a symmetric m: xx yy zz xy yz zx.
GRAUPEL_HD inline Vec3d solve(const double (&m)[6], const Vec3d& b) {
  const Vec3d x = {m[0], m[3], m[5]}, y = {m[3], m[1], m[4]}, z = {m[5], m[4], m[2]};
  const Vec3d yz = cross(y, z);
  return (yz * b[0] + cross(z, x) * b[1] + cross(x, y) * b[2]) * (1 / dot(x, yz));
}

/// push = mean a; inertia spin = sum m (x - centre) x a. No spin of what spans a period.
GRAUPEL_HD inline GroupChange change_of(const PlaceTerms& places, const PushTerms& pushes, bool spans_period) {
  const double mass = static_cast<double>(places.value[0]) / unit_of_way;
  const double of_ways = 1 / (unit_of_way * mass), of_pushes = 1 / (unit_of_acceleration * mass);
  GroupChange change;
  Vec3d twist;
  double square[6];
  for (int k = 0; k < 3; ++k) {
    change.centre[k] = static_cast<double>(places.value[1 + k]) * of_ways;
    change.push[k] = static_cast<double>(pushes.value[k]) * of_pushes;
    twist[k] = static_cast<double>(pushes.value[3 + k]) * of_pushes;
  }
  const Vec3d& centre = change.centre;
  for (int k = 0; k < 6; ++k)
    square[k] = static_cast<double>(places.value[4 + k]) * of_ways - centre[k % 3] * centre[k < 3 ? k : (k + 1) % 3];
  change.spin = Vec3d::zero();
  const double trace = square[0] + square[1] + square[2];
  if (spans_period || !(trace > least_inertia)) return change;
  const double spare = singular * trace;
  const double inertia[6] = {trace - square[0] + spare,
                             trace - square[1] + spare,
                             trace - square[2] + spare,
                             -square[3],
                             -square[4],
                             -square[5]};
  change.spin = solve(inertia, twist - cross(centre, change.push));
  return change;
}

/// Corrects particle i of a group that flies.
GRAUPEL_HD inline void correct(const Groups& groups, int64_t i, int32_t slot, const GroupChange& change, Vec3f* next) {
  const Vec3d by = change.push + cross(change.spin, groups.from_origin(i, slot) - change.centre);
  next[i] = next[i] - by.cast<float>();
}

}  // namespace graupel::graph::flight
