// The obstacles of a scene as signed-distance grids: built by OpenVDB (vdb/), kept as NanoVDB for look-up on
// any device.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle.h"

namespace graupel::sparsegrid {

/// Facts about one grid, for `graupel inspect`. Boxes of a grid without active voxels are zero, as are values of one
/// that holds no numbers (vectors, points).
struct GridFacts {
  std::string name, grid_class;
  double voxel = 0;  ///< [m]
  int64_t active_voxels = 0;
  int64_t bytes = 0;
  Vec3i index_low = {}, index_high = {};  ///< bounding box of the active voxels
  Vec3d world_low = {}, world_high = {};  ///< [m], in the grid's own frame
  bool holds_numbers = false;
  double background = 0;  ///< [m]
  double min_value = 0, max_value = 0;
};

/// Immutable after construction; copies share the grids.
class ObstacleSet {
 public:
  ObstacleSet() = default;
  /// Builds one narrow-band grid per obstacle (voxel scene.voxel(), half width scene.band()).
  /// Throws InputError for an open mesh or an unusable .vdb file, ConfigError for a shape that cannot be an obstacle.
  explicit ObstacleSet(const Scene& scene);

  /// The same obstacles where their scripts have them at `time` [s]; shares the grids.
  ObstacleSet at(double time) const;

  int count() const;
  /// View for kernels on `device`; valid as long as this set lives. The first call for cuda uploads the grids.
  ObstacleSetView view(Device device = Device::cpu) const;

  /// The lists of view(device); they hold for all poses that the obstacles' scripts give.
  ObstacleCells cells(Device device = Device::cpu) const;

  /// The views with the poses that the obstacles' scripts give at `time` [s], for kernels on `device`.
  std::vector<ObstacleView> views_at(double time, Device device = Device::cpu) const;
  /// Upper bound of the distance of the obstacle's initial surface (of a plane: inside the domain) from a point [m].
  double largest_distance(int obstacle, const Vec3d& from) const;

  /// Host look-ups of the union.
  SignedDistance<double> sample(const Vec3d& x, int* nearest = nullptr) const;

  GridFacts facts(int obstacle) const;
  /// Writes every obstacle's grid (own frame) and the union (world frame, grid "obstacles") into one .vdb file.
  void write_vdb(const std::string& path) const;

  struct Impl;

 private:
  std::shared_ptr<const Impl> impl_;
};

/// Facts of every grid of a .vdb file. Throws InputError.
std::vector<GridFacts> inspect_vdb(const std::string& path);

}  // namespace graupel::sparsegrid
