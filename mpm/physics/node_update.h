// Grid update of one node: velocity from momentum, gravity, contact with obstacles at rest, then with the walls, so
// that the walls hold. Moving obstacles: mpm/phases/update_grid.cpp.
#pragma once

#include "mpm/grid/scene_view.h"
#include "mpm/physics/contact.h"

namespace graupel::mpm {

/// Law of the obstacle at rest at a node. Deep inside, where no normal is known, the material stands still.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> meet_fixed_obstacle(const ObstacleNodeView<T>& obstacles, int64_t entry,
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
GRAUPEL_HD inline Vec<T, 3> meet_walls(const WallView<T>& walls, const Vec<T, 3>& x, T dx, Vec<T, 3> v) {
  for (int d = 0; d < 3; ++d) {
    const int side = wall_side(walls, x, dx, d) - 1;
    if (side < 0) continue;
    v = apply_contact(walls.contact[d][side], walls.friction[d][side], wall_normal<T>(d, side), v);
  }
  return v;
}

/// Velocity of node `inside` (0..63) of the block with directory index `key`, from its momentum [kg m/s] and mass > 0.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> updated_velocity(const SceneView<T>& scene, int32_t key, int inside,
                                             const Vec<T, 3>& momentum, T mass, T dt) {
  Vec<T, 3> v = momentum * (T(1) / mass) + dt * scene.gravity;
  const int32_t surface = scene.obstacle_nodes.block_number[key];
  if (surface != block_without_surface)
    v = meet_fixed_obstacle(scene.obstacle_nodes, int64_t(surface) * nodes_per_block<3> + inside, v);
  Vec<int, 3> at = node_in_block<3>(inside);
  const Vec<int, 3> block = scene.grid.block_of(key);
  for (int d = 0; d < 3; ++d) at[d] += block_width * block[d];
  return meet_walls(scene.walls, scene.grid.node_position(at), scene.grid.dx, v);
}

}  // namespace graupel::mpm
