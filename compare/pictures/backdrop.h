// What stands still in the pictures of a scene: floor with a grid, obstacles (sphere tracing of the signed distance,
// Hart 1996), edges of the box that holds the material. Made once per scene, size and camera.
#pragma once

#include <vector>

#include "compare/pictures/camera.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::compare {

/// Direction to the light, unit, for a given up axis.
Vec3d light_direction(const Vec3d& up);

struct Backdrop {
  Camera camera;              ///< of the supersampled picture: twice the size of the final one
  Vec3d up, low, high;        ///< up axis; corners of the box that holds the material [m]
  std::vector<float> depth;   ///< [pixels] along the camera's forward axis [m]; infinity where nothing is
  std::vector<Vec3f> albedo;  ///< [pixels] 0..1
  std::vector<Vec3f> normal;  ///< [pixels] zero for the sky
  std::vector<uint8_t> lit;   ///< [pixels] 1 where no obstacle shades the light
};

/// Supersampling factor of the pictures.
inline constexpr int supersampling = 2;

/// `width` x `height` is the size of the final picture [pixels].
Backdrop make_backdrop(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, int width, int height);

}  // namespace graupel::compare
