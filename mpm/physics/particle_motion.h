// Advection of one particle, kept inside the walls and out of obstacles, and the step_statistics of its new state.
#pragma once

#include "mpm/materials/material.h"
#include "mpm/physics/moving_contact.h"
#include "mpm/physics/step_report.h"

namespace graupel::mpm {

/// Directory index of the block that holds the base node of x, floor(x/dx - shift); in a plane run the plane's layer of
/// blocks is the only one.
template <typename T>
GRAUPEL_HD inline int32_t owner_key(const GridGeometry<T, 3>& grid, const Vec<T, 3>& x, T shift) {
  const Vec<T, 3> local = grid.local(x);
  Vec<int, 3> block;
  for (int d = 0; d < 3; ++d) block[d] = static_cast<int>(local[d] - shift) / block_width;
  return grid.directory_index(block);
}

/// From the signed distance at the nearest node, which phi at x can differ from by at most the distance between them
/// and a part of a voxel: whether x may lie inside an obstacle.
template <int D = 3, typename T>
GRAUPEL_HD inline bool near_surface(const SceneView<T>& scene, const Vec<T, 3>& x) {
  const ObstacleNodeView<T>& o = scene.obstacle_nodes;
  if (o.obstacles.count == 0) return false;
  const Vec<T, D> local = in_axes<D>(scene.grid.local(x));
  Vec<int, D> block;
  int inside = 0;
  T distance2 = 0;  // [cells^2]
  for (int d = 0; d < D; ++d) {
    const int node = static_cast<int>(local[d] + T(0.5));
    const T offset = local[d] - static_cast<T>(node);
    distance2 += offset * offset;
    block[d] = node / block_width;
    inside = inside * block_width + node % block_width;
  }
  const int32_t number = o.block_number[in_axes<D>(scene.grid).directory_index(block)];
  if (number == block_without_surface) return false;
  const T reach = (T(1.1) * std::sqrt(distance2) + T(0.35)) * scene.grid.dx;
  return o.phi[int64_t(number) * nodes_per_block<D> + inside] < reach;
}

/// `found` is a StepStatistics or has its members.
template <typename Found>
GRAUPEL_HD inline void mark_bad(int64_t slot, Found& found) {
  using Slot = decltype(found.bad_slot);
  if (found.bad_slot < 0 || slot < found.bad_slot) found.bad_slot = static_cast<Slot>(slot);
}

/// A particle that was pushed by `push` loses its velocity against that direction, relative to the surface, as in an
/// inelastic contact. Inlined whatever the number of its callers: see add_to_statistics.
template <typename T, typename Found>
[[gnu::always_inline]] GRAUPEL_HD inline void stop_at_surface(const Vec<T, 3>& push, T mass,
                                                              const Vec<T, 3>& surface_velocity, Vec<T, 3>& v,
                                                              Found& found) {
  ++found.pushed_out;
  const Vec<T, 3> normal = normalized(push);
  const T v_n = dot(normal, v - surface_velocity);
  if (!(v_n < T(0))) return;
  v = v - v_n * normal;
  for (int d = 0; d < 3; ++d) found.pushed_momentum[d] += static_cast<double>(-mass * v_n * normal[d]);
}

/// a + b that a GPU's compiler does not contract with the product that made b: all uses see one number.
template <typename T>
GRAUPEL_HD inline T rounded_sum(T a, T b) {
#ifdef __CUDA_ARCH__
  if constexpr (sizeof(T) == sizeof(float))
    return __fadd_rn(a, b);
  else
    return __dadd_rn(a, b);
#else
  return a + b;
#endif
}

/// Whether a step goes at most one cell along an axis, and along every axis (false for a number that is none).
template <typename S>
GRAUPEL_HD inline MaskOf<S> within_a_cell(const S& step, Real<S> dx) {
  return magnitude(step) <= dx;
}
template <typename T, int D>
GRAUPEL_HD inline bool within_a_cell(const Vec<T, D>& step, T dx) {
  bool within = true;
  for (int d = 0; d < D; ++d) within = within && within_a_cell(step[d], dx);
  return within;
}

/// The nearest point inside the walls.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> inside_walls(const WallView<T>& walls, Vec<T, 3> x) {
  for (int d = 0; d < 3; ++d) {
    x[d] = x[d] < walls.particle_low[d] ? walls.particle_low[d] : x[d];
    x[d] = x[d] > walls.particle_high[d] ? walls.particle_high[d] : x[d];
  }
  return x;
}

/// Projection out of obstacles of a particle that went from `before` to x, and the loss of velocity into what pushed it
/// there from where it wanted to be.
template <bool some_move, int D, typename T, typename Found>
[[gnu::always_inline]] GRAUPEL_HD inline void keep_out(const SceneView<T>& scene, const MovingObstacleView<T>& moving,
                                                       T mass, T dt, const Vec<T, 3>& before, const Vec<T, 3>& wanted,
                                                       Vec<T, 3>& x, Vec<T, 3>& v, Found& found) {
  Vec<T, 3> surface_velocity = Vec<T, 3>::zero(), from = before;
  const sparsegrid::ObstacleSetView* obstacles = &scene.obstacle_nodes.obstacles;
  bool near = false;
  if (some_move && scene.push_out && moving.count > 0 && near_moving(moving, x)) {
    near = true;
    obstacles = &moving.end;
    surface_velocity = velocity_of_nearest(moving, before, x);
    from = before + dt * surface_velocity;
  } else {
    near = scene.push_out && near_surface<D, T>(scene, x);
  }
  if (near) sparsegrid::push_out<D>(*obstacles, scene.walls.particle_low, scene.walls.particle_high, from, x);
  if (!(x == wanted)) stop_at_surface(x - wanted, mass, surface_velocity, v, found);
}

/// x <- x + dt v, kept inside the walls and, unless a script leads it, out of obstacles. False for a particle that
/// would move over one cell, or whose velocity is not a number: it stays where it is and is marked bad.
template <bool some_move, int D, typename T, typename Found>
[[gnu::always_inline]] GRAUPEL_HD inline bool move_point(const SceneView<T>& scene, const MovingObstacleView<T>& moving,
                                                         bool kinematic, int64_t slot, T mass, T dt, Vec<T, 3>& x,
                                                         Vec<T, 3>& v, Found& found) {
  const Vec<T, 3> before = x, step = dt * v;
  if (!within_a_cell(step, scene.grid.dx)) return mark_bad(slot, found), false;
  Vec<T, 3> wanted;
  for (int d = 0; d < 3; ++d) wanted[d] = rounded_sum(before[d], step[d]);
  x = inside_walls(scene.walls, wanted);
  if (!kinematic) keep_out<some_move, D>(scene, moving, mass, dt, before, wanted, x, v, found);
  return true;
}

/// Whether the deformation of a particle can go on, and its sound speed. F is read where
/// sound_speed_needs_deformation().
template <typename T, typename Found>
GRAUPEL_HD inline bool deformation_statistics(T dx, const MaterialParameters<T>& m, const Mat<T, 3>& F, T internal,
                                              T dt, Found& found) {
  if (!(internal_variable_is_volume_ratio(m.model) ? internal > T(0) : internal == internal)) return false;
  using Speed = decltype(found.largest_sound_speed);
  const T c = sound_speed(m, F, internal);
  if (static_cast<Speed>(c) > found.largest_sound_speed) found.largest_sound_speed = static_cast<Speed>(c);
  if (c * dt > dx) ++found.over_courant;
  return true;
}

/// Whether the motion of a particle can go on, and its speed.
template <typename T, typename Found>
GRAUPEL_HD inline bool velocity_statistics(const Vec<T, 3>& v, Found& found) {
  const T speed2 = norm2(v);
  if (!(speed2 < T(1e30))) return false;
  using Speed = decltype(found.largest_speed2);
  if (static_cast<Speed>(speed2) > found.largest_speed2) found.largest_speed2 = static_cast<Speed>(speed2);
  return true;
}

/// Both.
template <typename T, typename Found>
GRAUPEL_HD inline void state_statistics(T dx, const MaterialParameters<T>& m, int64_t slot, const Vec<T, 3>& v,
                                        const Mat<T, 3>& F, T internal, T dt, Found& found) {
  if (!velocity_statistics(v, found) || !deformation_statistics(dx, m, F, internal, dt, found)) mark_bad(slot, found);
}

}  // namespace graupel::mpm
