// Cell normals where some obstacles move: a moving obstacle carries its own cells, made once at its initial pose, along
// with it. So a pose costs nothing but its map.
#pragma once

#include <memory>
#include <vector>

#include "core/scene/motion.h"
#include "sparsegrid/cell_normals.h"

namespace graupel::sparsegrid {

/// The cells of one moving obstacle at one time, in the memory of one device.
struct CarriedNormalsView {
  CellNormalsView cells;        ///< at the initial pose; without a grid for a plane
  RigidMap back;                ///< to the initial pose
  Vec3d plane_point, plane_up;  ///< of a plane at the initial pose [m], unit vector

  /// A plane has one layer of cells, whose lower face lies in it.
  GRAUPEL_HD Vec3f at(const Vec3d& x) const {
    const Vec3d initial = back.rotation * x + back.translation;
    Vec3f normal;
    if (cells.grid == nullptr) {
      const double layer = dot(initial - plane_point, plane_up) * cells.inverse_spacing;
      normal = layer >= 0 && layer < 1 ? plane_up.cast<float>() : Vec3f::zero();
    } else {
      normal = cells.at(initial);
    }
    return (transpose(back.rotation) * normal.cast<double>()).cast<float>();
  }
};

/// The normals of all obstacles at one time, in the memory of one device.
struct ObstacleNormalsView {
  CellNormalsView resting;
  const CarriedNormalsView* carried = nullptr;  ///< [carried_count]
  int carried_count = 0;

  /// Unit normal at x: of obstacles that have one there, the direction of the sum. Zero where none has.
  GRAUPEL_HD Vec3f at(const Vec3d& x) const {
    Vec3f sum = resting.at(x);
    for (int k = 0; k < carried_count; ++k) {
      const Vec3f own = carried[k].at(x);
      const Vec3f both = sum + own;
      const bool are_two = norm2(sum) > 0 && norm2(own) > 0;
      const float length = norm(both);
      sum = !are_two ? both : length > 1e-6f ? both * (1 / length) : Vec3f::zero();
    }
    return sum;
  }
};

/// Immutable; copies share the grids.
class ObstacleNormals {
 public:
  /// At the start of the scene, whose obstacles `obstacles` has; spacing scene.domain.dx [m].
  ObstacleNormals(const Scene& scene, const ObstacleSet& obstacles);
  /// Where the obstacles' scripts have them at `time` [s].
  ObstacleNormals at(double time) const;

  Vec3f at(const Vec3d& x) const { return view().at(x); }
  int64_t active_cells() const;
  /// For kernels on `device`, which find what is carried there at `carried`, as carried_at gives it. The first call for
  /// cuda uploads the grids.
  ObstacleNormalsView view(Device device, const CarriedNormalsView* carried) const;
  /// For the CPU; valid as long as this lives.
  ObstacleNormalsView view() const { return view(Device::cpu, carried_.data()); }
  /// The obstacles that move, at `time` [s], for kernels on `device`.
  std::vector<CarriedNormalsView> carried_at(double time, Device device) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
  std::vector<CarriedNormalsView> carried_;
};

}  // namespace graupel::sparsegrid
