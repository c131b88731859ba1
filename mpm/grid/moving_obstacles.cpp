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
      start_(device, 0),
      end_(device, 0),
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
void MovingObstacles<T>::begin_step(double time, double dt) {
  std::vector<RigidStep<T>> steps(scene_.obstacles.size(), {Mat<T, 3>::zero(), Vec<T, 3>::zero(), Vec<T, 3>::zero()});
  for (const int32_t i : index_) {
    const Obstacle& obstacle = scene_.obstacles[static_cast<std::size_t>(i)];
    RigidStep<T>& step = steps[static_cast<std::size_t>(i)];
    step = rigid_step<T>(*obstacle.motion, obstacle.position, time, dt);
    if (scene_.domain.is_plane()) step = in_plane(step);
  }
  start_.upload(obstacles_.views_at(time, device_));
  end_.upload(obstacles_.views_at(time + dt, device_));
  steps_.upload(steps);
}

template <typename T>
MovingObstacleView<T> MovingObstacles<T>::view() const {
  const sparsegrid::ObstacleCells cells = obstacles_.cells(device_);
  return {static_cast<int32_t>(index_.size()),
          device_index_.data(),
          {start_.data(), static_cast<int>(start_.size()), cells},
          {end_.data(), static_cast<int>(end_.size()), cells},
          steps_.data()};
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
