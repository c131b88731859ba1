// The cheaper form of a scene that learned models are measured against: a coarser grid (fast_step.h has larger steps).
#include <algorithm>

#include "mpm/simulation.h"

namespace graupel::mpm {

/// The walls stay where they are: the domain's faces move, so that the walls are again a whole number of cells inside.
Scene coarse_variant(const Scene& scene) {
  Scene coarse = scene;
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  coarse.domain.dx = 2 * scene.domain.dx;
  coarse.domain.wall_cells = std::max<int64_t>(2, (scene.domain.wall_cells + 1) / 2);
  const Vec3d margin = Vec3d::filled(static_cast<double>(coarse.domain.wall_cells) * coarse.domain.dx);
  coarse.domain.origin = low - margin;
  coarse.domain.size = high - low + 2.0 * margin;
  coarse.obstacle_voxel = scene.voxel();
  coarse.obstacle_band = std::max(scene.band(), 4 * coarse.domain.dx);
  coarse.time_step.substeps_per_frame = std::max<int64_t>(1, (scene.time_step.substeps_per_frame + 1) / 2);
  return coarse;
}

}  // namespace graupel::mpm
