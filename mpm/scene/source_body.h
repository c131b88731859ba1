// A body to be filled with particles: inside test, bounds and volume, in its own frame.
#pragma once

#include "core/scene/scene.h"
#include "sparsegrid/analytic_shape.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

/// Volume of a body in its own frame [m^3]: exact for analytic shapes and meshes, 0 for all others.
double body_volume(const Body& body);

class SourceBody {
 public:
  /// `voxel` [m] is the resolution of the inside test of meshes and .vdb level sets.
  /// Throws ConfigError for a plane, which has no volume.
  SourceBody(const Source& source, std::size_t index, double voxel);

  bool contains(const Vec3d& local) const;
  const sparsegrid::LocalBox& bounds() const { return bounds_; }
  /// Exact for analytic shapes and meshes; of .vdb level sets by counting lattice points.
  double volume() const { return volume_; }

 private:
  double level_set_volume() const;

  Source source_;
  sparsegrid::ObstacleSet level_set_;  ///< one obstacle, for mesh and vdb
  sparsegrid::LocalBox bounds_;
  double volume_ = 0;
};

}  // namespace graupel::mpm
