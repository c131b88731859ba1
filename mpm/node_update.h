// Grid update of one node: velocity from momentum, gravity, contact with obstacles at rest, then with the walls, so
// that the walls hold. Moving obstacles: mpm/grid_update.cpp.
#pragma once

#include "mpm/contact.h"
#include "mpm/scene_view.h"

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

/// Walls act on the nodes on and behind their planes.
template <typename T>
GRAUPEL_HD inline Vec<T, 3> meet_walls(const WallView<T>& walls, const Vec<T, 3>& x, T dx, Vec<T, 3> v) {
  const T tolerance = T(1e-3) * dx;
  for (int d = 0; d < 3; ++d) {
    Vec<T, 3> normal = Vec<T, 3>::zero();
    if (x[d] < walls.low[d] + tolerance) normal[d] = T(1);
    if (x[d] > walls.high[d] - tolerance) normal[d] = T(-1);
    const int side = normal[d] < T(0) ? 1 : 0;
    if (normal[d] != T(0)) v = apply_contact(walls.contact[d][side], walls.friction[d][side], normal, v);
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
