// The constants of one scene as kernels read them: grid, walls, gravity, obstacles at rest, materials.
#pragma once

#include "mpm/grid/grid.h"
#include "mpm/grid/obstacle_nodes.h"
#include "mpm/materials/material_parameters.h"

namespace graupel::mpm {

/// The period of an axis in nodes.
struct PeriodicAxis {
  int low_node;  ///< node on the lower wall
  int cells;     ///< of the period; 0: the axis is not periodic
};

/// What holds the material at the walls, and where it may pass. Index [axis][side], side 0 the lower one.
template <typename T>
struct WallView {
  Vec<T, 3> low, high;                    ///< wall planes; nodes on and behind them are held; far off where none is [m]
  Vec<T, 3> particle_low, particle_high;  ///< no particle leaves this box [m]
  Contact contact[3][2];
  T friction[3][2];
  bool has_gates;                 ///< whether a wall is open or periodic
  Vec<T, 3> gate_low, gate_high;  ///< planes of open and periodic walls; far off where none is [m]
  PeriodicAxis periodic[3];
};

/// The walls of a scene. Throws ConfigError for a periodic wall without its partner, or not whole cells from it.
template <typename T>
WallView<T> wall_view(const Scene& scene);

template <typename T>
struct SceneView {
  GridGeometry<T, 3> grid;
  WallView<T> walls;
  Vec<T, 3> gravity;                   ///< [m/s^2]
  bool push_out;                       ///< keep particles out of obstacles
  ObstacleNodeView<T> obstacle_nodes;  ///< of obstacles at rest
  const MaterialParameters<T>* materials;
};

}  // namespace graupel::mpm
