#include "mpm/grid/moving_obstacles.h"

#include <algorithm>

namespace graupel::mpm {

using sparsegrid::ObstacleSetView;
using sparsegrid::ObstacleView;

template <typename T>
MovingObstacles<T>::MovingObstacles(Device device, const Scene& scene, const sparsegrid::ObstacleSet& obstacles)
    : device_(device),
      obstacles_(obstacles),
      device_index_(device, 0),
      fixed_(device, 0),
      poses_(device, 0),
      steps_(device, 0) {
  scene_.domain = scene.domain;
  scene_.obstacles = scene.obstacles;
  std::vector<ObstacleView> fixed = obstacles.views_at(0, device);
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    const Obstacle& obstacle = scene.obstacles[i];
    if (!obstacle.motion) continue;
    index_.push_back(static_cast<int32_t>(i));
    reach_.push_back(
        obstacles.largest_distance(static_cast<int>(i), obstacle.motion->center.value_or(obstacle.position)));
    sparsegrid::ObstacleFrame<double> nowhere = fixed[i].exact;
    nowhere.low = nowhere.solid_low = Vec3d::filled(1);  // an empty box: every look-up ends there
    nowhere.high = nowhere.solid_high = Vec3d::filled(-1);
    fixed[i].set_frame(nowhere);
  }
  if (!any()) return;
  fixed_.upload(fixed);
  device_index_.upload(index_);
  begin_step(0, 1);
}

template <typename T>
ObstacleSetView MovingObstacles<T>::fixed() const {
  if (index_.size() == scene_.obstacles.size()) return {nullptr, 0};
  return any() ? ObstacleSetView{fixed_.data(), static_cast<int>(fixed_.size()), obstacles_.cells(device_)}
               : obstacles_.view(device_);
}

template <typename T>
ObstacleSteps<T> MovingObstacles<T>::substeps(double time, double dt, int64_t count) const {
  const std::size_t obstacles = scene_.obstacles.size();
  ObstacleSteps<T> all;
  all.poses.reserve(static_cast<std::size_t>(count + 1) * obstacles);
  all.steps.assign(static_cast<std::size_t>(count) * obstacles,
                   {Mat<T, 3>::zero(), Vec<T, 3>::zero(), Vec<T, 3>::zero()});
  for (int64_t s = 0; s <= count; ++s) {
    const double start = time + static_cast<double>(s) * dt;
    const std::vector<ObstacleView> poses = obstacles_.views_at(start, device_);
    all.poses.insert(all.poses.end(), poses.begin(), poses.end());
    if (s == count) break;
    for (const int32_t i : index_) {
      const Obstacle& obstacle = scene_.obstacles[static_cast<std::size_t>(i)];
      const RigidStep<T> step = rigid_step<T>(*obstacle.motion, obstacle.position, start, dt);
      all.steps[static_cast<std::size_t>(s) * obstacles + static_cast<std::size_t>(i)] =
          scene_.domain.is_plane() ? in_plane(step) : step;
    }
  }
  return all;
}

template <typename T>
void MovingObstacles<T>::begin_step(double time, double dt) {
  const ObstacleSteps<T> one = substeps(time, dt, 1);
  poses_.upload(one.poses);
  steps_.upload(one.steps);
}

template <typename T>
MovingObstacleView<T> MovingObstacles<T>::view_of(const ObstacleView* poses, const RigidStep<T>* steps) const {
  const sparsegrid::ObstacleCells cells = obstacles_.cells(device_);
  const int obstacles = any() ? static_cast<int>(scene_.obstacles.size()) : 0;
  return {static_cast<int32_t>(index_.size()),
          device_index_.data(),
          {poses, obstacles, cells},
          {poses + obstacles, obstacles, cells},
          steps};
}

template <typename T>
double MovingObstacles<T>::largest_speed(double from, double to) const {
  double fastest = 0;
  for (std::size_t k = 0; k < index_.size(); ++k) {
    double speed, angular_speed;
    scene_.obstacles[static_cast<std::size_t>(index_[k])].motion->fastest(from, to, speed, angular_speed);
    fastest = std::max(fastest, speed + angular_speed * reach_[k]);
  }
  return fastest;
}

template class MovingObstacles<float>;
template class MovingObstacles<double>;

}  // namespace graupel::mpm
