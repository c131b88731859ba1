// Which obstacle acts where: the choices of apply_obstacles() and keep_out(), for those who keep count of it.
#pragma once

#include "mpm/physics/node_update.h"

namespace graupel::mpm {

/// The obstacle whose law apply_obstacles() takes at a node, its place in the scene; -1 for none.
template <bool some_move, int D, typename T>
GRAUPEL_HD inline int32_t acting_obstacle(const SceneView<T>& scene, const MovingObstacleView<T>& moving, int32_t key,
                                          int inside, const Vec<T, 3>& x) {
  const ObstacleNodeView<T>& nodes = scene.obstacle_nodes;
  const int32_t surface = nodes.block_number[key];
  const int64_t entry = int64_t(surface) * nodes_per_block<D> + inside;
  const int32_t fixed = surface != block_without_surface ? nodes.law[entry] : -1;
  if constexpr (some_move) {
    sparsegrid::SignedDistance<T> here{};
    const int32_t index = holding_obstacle<D>(moving, x, scene.grid.dx, here);
    if (index >= 0 && !(fixed >= 0 && nodes.phi[entry] <= here.phi)) return index;
  }
  return fixed;
}

/// The obstacle that keep_out() pushes a particle out of which is at x, inside the walls, at the end of a substep.
template <bool some_move, typename T>
GRAUPEL_HD inline int32_t pushing_obstacle(const SceneView<T>& scene, const MovingObstacleView<T>& moving,
                                           const Vec<T, 3>& x) {
  const bool is_moving = some_move && moving.count > 0 && near_moving(moving, x);
  int nearest;
  sparsegrid::signed_distance(is_moving ? moving.end : scene.obstacle_nodes.obstacles, x, nearest);
  return nearest;
}

}  // namespace graupel::mpm
