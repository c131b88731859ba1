// Walls, obstacles and materials of a scene, for kernels of any device.
#pragma once

#include "core/scene/domain.h"
#include "core/scene/motion.h"
#include "graph/features/material_constants.h"
#include "sparsegrid/obstacle.h"
#include "sparsegrid/obstacle_normals.h"

namespace graupel::graph {

/// What a surface does to material that touches it.
struct SurfaceContact {
  Contact kind = Contact::separate;
  float friction = 0;  ///< Coulomb coefficient; 0 of those that stick
};

/// Environment in the memory of one device (graph/features/features.h, Environment::view).
struct EnvironmentView {
  sparsegrid::ObstacleSetView obstacles;
  sparsegrid::ObstacleNormalsView normals;
  Vec3d wall_low, wall_high;  ///< [m]; far away along z in the plane, which has no walls there
  bool plane = false;         ///< two dimensions: normals have no part along z
  Vec3d hold_low, hold_high;  ///< [m] where walls hold the material; far away at open and periodic walls
  SurfaceContact wall[6];     ///< lower x y z, upper x y z
  const MaterialConstants* materials = nullptr;
  const RigidMap* carried_from = nullptr;  ///< [obstacles] where each was a frame before; null: all rest
};

}  // namespace graupel::graph
