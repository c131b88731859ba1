#include "sparsegrid/obstacle_normals.h"

namespace graupel::sparsegrid {

namespace {

/// An obstacle that moves.
struct Carrier {
  Obstacle obstacle;
  CellNormals cells;
};

SurfaceChoice without_moving(const std::vector<Obstacle>& obstacles) {
  SurfaceChoice choice;
  for (const Obstacle& obstacle : obstacles) choice.left_out.push_back(obstacle.motion.has_value());
  return choice;
}

SurfaceChoice only(std::size_t obstacle, std::size_t count) {
  SurfaceChoice choice{std::vector<bool>(count, true), true};
  choice.left_out[obstacle] = false;
  return choice;
}

RigidMap inverse(const RigidMap& map) {
  const Mat3d rotation = transpose(map.rotation);
  return {rotation, -(rotation * map.translation)};
}

}  // namespace

struct ObstacleNormals::Impl {
  CellNormals resting;
  std::vector<Carrier> carriers;
  double inverse_spacing;  ///< [1/m]
};

ObstacleNormals::ObstacleNormals(const Scene& scene, const ObstacleSet& obstacles) {
  auto impl = std::make_shared<Impl>();
  impl->resting = CellNormals(scene, obstacles, without_moving(scene.obstacles));
  impl->inverse_spacing = 1 / scene.domain.dx;
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    const Obstacle& obstacle = scene.obstacles[i];
    if (!obstacle.motion) continue;
    const bool is_plane = obstacle.shape == Shape::plane;
    impl->carriers.push_back(
        {obstacle, is_plane ? CellNormals() : CellNormals(scene, obstacles, only(i, scene.obstacles.size()))});
  }
  impl_ = std::move(impl);
  carried_ = carried_at(0, Device::cpu);
}

ObstacleNormals ObstacleNormals::at(double time) const {
  ObstacleNormals placed = *this;
  placed.carried_ = carried_at(time, Device::cpu);
  return placed;
}

int64_t ObstacleNormals::active_cells() const {
  int64_t cells = impl_->resting.active_cells();
  for (const Carrier& carrier : impl_->carriers) cells += carrier.cells.active_cells();
  return cells;
}

ObstacleNormalsView ObstacleNormals::view(Device device, const CarriedNormalsView* carried) const {
  return {impl_->resting.view(device), carried, static_cast<int>(impl_->carriers.size())};
}

std::vector<CarriedNormalsView> ObstacleNormals::carried_at(double time, Device device) const {
  std::vector<CarriedNormalsView> carried;
  for (const Carrier& carrier : impl_->carriers) {
    const Obstacle& obstacle = carrier.obstacle;
    CarriedNormalsView& view = carried.emplace_back();
    view.cells = carrier.cells.view(device);
    view.cells.inverse_spacing = impl_->inverse_spacing;
    view.back = inverse(obstacle.motion->at(time, obstacle.position));
    view.plane_point = obstacle.position;
    view.plane_up = obstacle.rotation() * Vec3d{0, 1, 0};
  }
  return carried;
}

}  // namespace graupel::sparsegrid
