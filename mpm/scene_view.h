// The constants of one scene as kernels read them: grid, walls, gravity, obstacles, materials.
#pragma once

#include "mpm/grid.h"
#include "mpm/material_parameters.h"
#include "mpm/obstacle_nodes.h"

namespace graupel::mpm {

/// What holds the material at the walls.
template <typename T>
struct WallView {
  Vec<T, 3> low, high;                    ///< wall planes; nodes on and behind them are held [m]
  Vec<T, 3> particle_low, particle_high;  ///< no particle leaves this box [m]
  Contact contact;
  T friction;
};

/// The walls of a scene. Without push_out particles may creep past the walls, but never so far that their stencil
/// leaves the grid.
template <typename T>
inline WallView<T> wall_view(const Scene& scene) {
  WallView<T> walls;
  walls.low = scene.wall_low().cast<T>();
  walls.high = scene.wall_high().cast<T>();
  const Vec3d inset = Vec3d::filled(0.6 * scene.domain.dx);
  walls.particle_low = scene.push_out ? walls.low : (scene.domain.origin + inset).cast<T>();
  walls.particle_high = scene.push_out ? walls.high : (scene.domain.origin + scene.domain.size - inset).cast<T>();
  walls.contact = scene.domain.walls;
  walls.friction = static_cast<T>(scene.domain.wall_friction);
  return walls;
}

template <typename T>
struct SceneView {
  GridGeometry<T, 3> grid;
  WallView<T> walls;
  Vec<T, 3> gravity;  ///< [m/s^2]
  bool push_out;      ///< keep particles out of obstacles
  ObstacleNodeView<T> obstacle_nodes;
  const MaterialParameters<T>* materials;
};

}  // namespace graupel::mpm
