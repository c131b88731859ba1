#include "core/scene/contact_force.h"

#include "core/scene/scene.h"

namespace graupel {

std::vector<std::string> contact_names(const Scene& scene) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) names.push_back("obstacle_" + std::to_string(i));
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const char* side : {"_low", "_high"}) names.push_back(std::string("wall_") + "xyz"[axis] + side);
  return names;
}

std::vector<Vec3d> contact_references(const Scene& scene, double time) {
  std::vector<Vec3d> points;
  for (const Obstacle& obstacle : scene.obstacles) {
    Vec3d point = obstacle.position;
    if (obstacle.motion) {
      point = obstacle.motion->center.value_or(obstacle.position);
      point = obstacle.motion->at(time, obstacle.position)(point);
    }
    points.push_back(point);
  }
  const Vec3d low = scene.wall_low(), high = scene.wall_high();
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const Vec3d& corner : {low, high}) {
      Vec3d point = 0.5 * (low + high);
      point[axis] = corner[axis];
      points.push_back(point);
    }
  if (scene.domain.is_plane())
    for (Vec3d& point : points) point[2] = scene.domain.plane();
  return points;
}

}  // namespace graupel
