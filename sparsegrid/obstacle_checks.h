// What is refused of obstacles before their grids are built: meshes that bound no volume, grids that are too large.
#pragma once

#include <string>

#include "core/scene/scene.h"

namespace graupel::sparsegrid {

inline constexpr double smallest_voxel = 2e-5;  ///< [m] OpenVDB refuses transforms whose determinant is about 1e-15

/// "the mesh 'a.obj'", or "the mesh" where it comes from arrays.
std::string mesh_words(const Obstacle& obstacle);

/// Throws InputError where the mesh is missing, has no triangles, or does not bound a volume once.
void check_mesh(const Obstacle& obstacle, const std::string& name);

/// A surface that a level set is made of.
struct SurfaceSize {
  double area = 0;    ///< [m^2]
  double extent = 0;  ///< largest coordinate [m]
};
SurfaceSize size_of(const TriangleMesh& mesh);

/// Throws ConfigError where the level set of `what` ("the mesh 'a.obj'") would have more than 2^26 voxels in its band
/// of `width` voxels on each side, or coordinates beyond 2^21 voxels: it would take minutes and gigabytes.
void check_level_set_size(const std::string& name, const std::string& what, const SurfaceSize& surface, double voxel,
                          double width);

/// About the bytes of the obstacles' grids together; .vdb files are left out.
double grid_bytes(const Scene& scene);
/// Throws ConfigError where these are more than `available`.
void check_grids_fit(const Scene& scene, double available);

}  // namespace graupel::sparsegrid
