// Average obstacle normal per grid cell, stored sparsely (HGN paper, section 3): the surface is sampled with points of
// which no two are closer than dx/4; a point's normal is flipped when it looks away from the centre of its cell; the
// normals of a cell are added and normalised. Cells without surface hold zero.
#pragma once

#include <memory>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::sparsegrid {

/// Poisson-disk points on the surface of the union of obstacles (points inside another obstacle are left out).
struct SurfaceSamples {
  std::vector<Vec3d> position;  ///< [m]
  std::vector<Vec3d> normal;    ///< outward unit normals
};
/// Which surfaces are sampled, and where.
struct SurfaceChoice {
  std::vector<bool> left_out = {};  ///< [obstacles] as if they were not there; empty: none
  bool is_whole = false;            ///< beyond the domain, too
};
/// No two points closer than `spacing` [m], no hole over 2 `spacing`; the same for the same scene and seed.
SurfaceSamples sample_surface(const Scene& scene, const ObstacleSet& obstacles, double spacing, uint64_t seed = 0,
                              const SurfaceChoice& choice = {});

/// The normals in the memory of one device.
struct CellNormalsView {
  const nanovdb::Vec3fGrid* grid = nullptr;  ///< null without obstacles
  Vec3d origin;                              ///< [m]
  double inverse_spacing = 0;                ///< [1/m]

  /// Normal of the cell that holds x, zero when no surface passes through it.
  GRAUPEL_HD Vec3f at(const Vec3d& x) const {
    if (grid == nullptr) return Vec3f::zero();
    const Vec3d u = (x - origin) * inverse_spacing;
    const nanovdb::Vec3f n = grid->tree().getValue(nanovdb::Coord(
        static_cast<int>(std::floor(u[0])), static_cast<int>(std::floor(u[1])), static_cast<int>(std::floor(u[2]))));
    return {n[0], n[1], n[2]};
  }
};

/// Sparse grid of unit normals (NanoVDB Vec3f), cell (i,j,k) covers origin + [i, i+1) dx.
class CellNormals {
 public:
  CellNormals() = default;
  /// Spacing scene.domain.dx, samples at dx/4.
  CellNormals(const Scene& scene, const ObstacleSet& obstacles, const SurfaceChoice& choice = {});

  /// Normal of the cell that holds x, zero when no surface passes through it.
  Vec3f at(const Vec3d& x) const { return view().at(x); }
  int64_t active_cells() const;
  std::size_t bytes() const;
  /// View for kernels on `device`; the first call for cuda uploads the grid.
  CellNormalsView view(Device device = Device::cpu) const;
  void write_vdb(const std::string& path) const;

  struct Impl;

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace graupel::sparsegrid
