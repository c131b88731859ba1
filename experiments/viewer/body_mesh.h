// Surfaces of obstacles as triangles for the viewer's page: exact corners of analytic bodies, meshes as they were read,
// and the zero level of level sets.
#pragma once

#include <functional>

#include "core/scene/mesh.h"
#include "core/scene/scene.h"

namespace graupel::experiments {

/// In the world at time 0, counter-clockwise seen from outside. A plane is cut to the domain's walls. Empty for points.
TriangleMesh body_mesh(const Scene& scene, const Obstacle& obstacle);

/// Zero level of `distance` (negative inside) between two corners [m], with a vertex in each cell of `spacing` [m] that
/// the surface passes through: surface nets (Gibson 1998).
TriangleMesh level_set_mesh(const std::function<double(const Vec3d&)>& distance, const Vec3d& low, const Vec3d& high,
                            double spacing);

/// A corner of a triangle as the page gets it.
struct SurfaceCorner {
  Vec3f position;    ///< [m]
  int8_t normal[4];  ///< outward, times 127; the last is 0
};
static_assert(sizeof(SurfaceCorner) == 16);

/// Three corners for each triangle. Normals are the mean of the faces at the vertex that meet at less than 40 degrees:
/// edges stay sharp, round bodies look round.
std::vector<SurfaceCorner> shaded_corners(const TriangleMesh& mesh);

}  // namespace graupel::experiments
