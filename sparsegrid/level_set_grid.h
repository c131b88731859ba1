// What vdb/ offers to the rest of this folder without showing OpenVDB: level sets as NanoVDB bytes.
#pragma once

#include <nanovdb/NanoVDB.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/buffer.h"
#include "core/scene/scene.h"
#include "sparsegrid/analytic_shape.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::sparsegrid {

/// Distance [m] at a point; must be callable from several threads.
using DistanceFunction = std::function<double(const Vec3d&)>;

/// Narrow-band level set: |phi| < band on active voxels, +band outside, -band inside everywhere else.
struct LevelSetGrid {
  Buffer<char> bytes;  ///< a nanovdb::FloatGrid, host memory; voxel (i,j,k) lies at (i,j,k) * voxel
  GridFacts facts;
  LocalBox near;   ///< box outside which the interpolated value is +band [m]
  LocalBox solid;  ///< box outside which the interpolated value is positive [m]; low > high when nothing is inside
  const nanovdb::FloatGrid* grid() const { return reinterpret_cast<const nanovdb::FloatGrid*>(bytes.data()); }
};

/// The level set of an obstacle in its own frame. A plane is cut to the scene's domain (and its band around it).
/// Throws InputError for an unusable mesh or .vdb file.
LevelSetGrid build_level_set(const Scene& scene, const Obstacle& obstacle, const std::string& name);

/// A plane as the closed body that it bounds in the domain, its other faces farther than the band outside the domain;
/// `near` is about the plane alone.
LevelSetGrid build_plane_body(const Scene& scene, const Obstacle& plane, const std::string& name);

/// The values in the box of the narrow band, or of the solid and a few voxels around it where that one has more than
/// `most_dense_voxels`, as `box` then says (its `values` excepted); none where both have more.
inline constexpr double most_dense_voxels = 1 << 22;
std::vector<float> dense_values(const LevelSetGrid& level_set, double voxel, DenseValues& box);

/// Level set of `distance` (already clamped to +-band) sampled in `boxes`.
struct UnionRequest {
  DistanceFunction distance;
  std::vector<LocalBox> boxes;     ///< around the bands [m]
  std::vector<LocalBox> insides;   ///< where planes' bodies reach beyond these boxes [m]
  std::optional<LocalBox> border;  ///< cuts the union where there are insides [m]
  double voxel = 0, band = 0;      ///< [m]
};

/// Writes the grids by these names and, called "obstacles", the union. Throws IoError.
void write_level_sets(const std::string& path, const std::vector<const LevelSetGrid*>& grids,
                      const std::vector<std::string>& names, const UnionRequest& union_request);

/// Sparse grid of vectors: value[n] on cell coordinate[n], zero elsewhere.
struct VectorGrid {
  Buffer<char> bytes;  ///< a nanovdb::Vec3fGrid, host memory
  int64_t active_cells = 0;
  const nanovdb::Vec3fGrid* grid() const { return reinterpret_cast<const nanovdb::Vec3fGrid*>(bytes.data()); }
};
/// Cell c is centred at origin + (c + 1/2) spacing.
VectorGrid build_vector_grid(const std::vector<Vec3i>& coordinate, const std::vector<Vec3f>& value, double spacing,
                             const Vec3d& origin, const std::string& name);
void write_vector_grid(const std::string& path, const VectorGrid& grid);

}  // namespace graupel::sparsegrid
