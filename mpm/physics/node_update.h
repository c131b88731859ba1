// Grid update of one node: velocity from momentum, gravity, contact with obstacles, then with the walls, so that the
// walls hold.
#pragma once

#include <limits>

#include "mpm/physics/contact.h"
#include "mpm/physics/moving_contact.h"

namespace graupel::mpm {

/// Law of the obstacle at rest at a node. Deep inside, where no normal is known, the material stands still.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> apply_fixed_obstacle(const ObstacleNodeView<T>& obstacles, int64_t entry,
                                                 const Vec<T, 3>& v) {
  const int32_t law = obstacles.law[entry];
  if (law < 0) return v;
  const Vec<T, 3> normal = obstacles.normal[entry];
  if (norm2(normal) == T(0)) return Vec<T, 3>::zero();
  const sparsegrid::ObstacleView& obstacle = obstacles.obstacles.obstacles[law];
  return apply_contact(obstacle.contact, static_cast<T>(obstacle.friction), normal, v);
}

/// Which wall of an axis acts on a node at x, those on and behind its plane: 0 none, 1 the lower, 2 the upper one.
template <typename T>
GRAUPEL_HD inline int wall_side(const WallView<T>& walls, const Vec<T, 3>& x, T dx, int axis) {
  const T tolerance = T(1e-3) * dx;
  if (x[axis] > walls.high[axis] - tolerance) return 2;
  return x[axis] < walls.low[axis] + tolerance ? 1 : 0;
}

/// Normal of the wall at a side (0 lower, 1 upper) of an axis.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> wall_normal(int axis, int side) {
  Vec<T, 3> normal = Vec<T, 3>::zero();
  normal[axis] = side == 1 ? T(-1) : T(1);
  return normal;
}

template <typename T>
GRAUPEL_HD inline Vec<T, 3> apply_walls(const WallView<T>& walls, const Vec<T, 3>& x, T dx, Vec<T, 3> v) {
  for (int d = 0; d < 3; ++d) {
    const int side = wall_side(walls, x, dx, d) - 1;
    if (side < 0) continue;
    v = apply_contact(walls.contact[d][side], walls.friction[d][side], wall_normal<T>(d, side), v);
  }
  return v;
}

/// The law of the deeper one of the obstacles at rest and the moving ones, at node `inside` of the block with directory
/// index `key`, which lies at x.
template <bool some_move, int D, typename T>
GRAUPEL_HD inline Vec<T, 3> apply_obstacles(const SceneView<T>& scene, const MovingObstacleView<T>& moving, int32_t key,
                                            int inside, const Vec<T, 3>& x, const Vec<T, 3>& v) {
  const int32_t surface = scene.obstacle_nodes.block_number[key];
  const int64_t entry = int64_t(surface) * nodes_per_block<D> + inside;
  if constexpr (some_move) {
    sparsegrid::SignedDistance<T> here{};
    const int32_t index = holding_obstacle<D>(moving, x, scene.grid.dx, here);
    const bool fixed_is_deeper = surface != block_without_surface && scene.obstacle_nodes.law[entry] >= 0 &&
                                 scene.obstacle_nodes.phi[entry] <= here.phi;
    if (index >= 0 && !fixed_is_deeper) {
      const Vec<T, 3> u = moving.step[index].velocity_at(x);
      if (norm2(here.normal) == T(0)) return u;
      const sparsegrid::ObstacleView& obstacle = moving.start.obstacles[index];
      return u + apply_contact(obstacle.contact, static_cast<T>(obstacle.friction), here.normal, v - u);
    }
  }
  return surface != block_without_surface ? apply_fixed_obstacle(scene.obstacle_nodes, entry, v) : v;
}

/// Nodes with less are empty [kg]: the reciprocal of a smaller mass is no number. A spline's weight is that small where
/// a particle's support just reaches a node, f^2 / 2 (quadratic) or f^3 / 6 (cubic) along each axis.
template <typename T>
inline constexpr T least_node_mass = std::numeric_limits<T>::min();

/// Velocity of a node after gravity, before contact: p / m + dt g. `gain` is dt g.
template <typename Velocity, typename S>
GRAUPEL_HD inline Velocity free_velocity(const Velocity& momentum, const S& inverse_mass, const Velocity& gain) {
  return momentum * inverse_mass + gain;
}

/// Velocity of node `inside` of the block with directory index `key`, which lies at x, from its momentum [kg m/s] and
/// mass, least_node_mass or more.
template <bool some_move, int D, typename T>
GRAUPEL_HD inline Vec<T, 3> updated_velocity(const SceneView<T>& scene, const MovingObstacleView<T>& moving,
                                             int32_t key, int inside, const Vec<T, 3>& x, const Vec<T, 3>& momentum,
                                             T mass, T dt) {
  const Vec<T, 3> v = free_velocity(momentum, T(1) / mass, dt * scene.gravity);
  return apply_walls(scene.walls, x, scene.grid.dx, apply_obstacles<some_move, D>(scene, moving, key, inside, x, v));
}

}  // namespace graupel::mpm
