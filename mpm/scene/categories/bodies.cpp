#include "mpm/scene/categories/bodies.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/system/error.h"
#include "sparsegrid/mesh/mesh_volume.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

namespace {

constexpr double pi = 3.14159265358979323846;

sparsegrid::LocalBox bounds_of(const TriangleMesh& mesh) {
  sparsegrid::LocalBox box = {Vec3d::filled(1e300), Vec3d::filled(-1e300)};
  for (const Vec3d& x : mesh.vertices)
    for (int d = 0; d < 3; ++d) {
      box.low[d] = std::min(box.low[d], x[d]);
      box.high[d] = std::max(box.high[d], x[d]);
    }
  return box;
}

double largest(const Vec3d& x) { return std::max({x[0], x[1], x[2]}); }

/// As a reader of the scene scales it, to the bit.
std::shared_ptr<const TriangleMesh> scaled(const TriangleMesh& mesh, double scale) {
  auto copy = std::make_shared<TriangleMesh>(mesh);
  for (Vec3d& x : copy->vertices) x *= scale;
  return copy;
}

}  // namespace

sparsegrid::LocalBox bounds_of(const RecipeGeometry& geometry) {
  if (geometry.mesh) return bounds_of(*geometry.mesh);
  const auto grids = sparsegrid::inspect_vdb(geometry.file);
  if (grids.empty()) throw InputError("'" + geometry.file + "' holds no grid. Name a .vdb file with a level set");
  // The active voxels reach a band beyond the surface, less than a voxel short of the background's distance.
  const sparsegrid::GridFacts& grid = grids.front();
  if (grid.active_voxels == 0)
    throw InputError("the first grid of '" + geometry.file + "' is empty (0 active voxels). Name another .vdb file");
  const Vec3d band = Vec3d::filled(std::max(0.0, grid.background - grid.voxel));
  return {grid.world_low + band, grid.world_high - band};
}

void use_geometry(Body& body, Shape shape, const RecipeGeometry& geometry, double size) {
  const sparsegrid::LocalBox box = bounds_of(geometry);
  body.shape = shape;
  body.file = geometry.file;
  body.scale = size / largest(box.high - box.low);
  if (geometry.mesh) body.mesh = scaled(*geometry.mesh, body.scale);
}

Body envelope(const Body& body, const sparsegrid::LocalBox& file_box) {
  if (sparsegrid::is_analytic(body.shape)) return body;
  Body box = body;
  box.shape = Shape::box;
  box.size = file_box.high - file_box.low;
  box.position = body.to_world((file_box.low + file_box.high) * 0.5);
  return box;
}

sparsegrid::LocalBox world_extent(const Body& envelope) {
  const sparsegrid::LocalBox box = sparsegrid::analytic_bounds(envelope);
  const Mat3d rotation = envelope.rotation();
  sparsegrid::LocalBox world = {Vec3d::filled(1e300), Vec3d::filled(-1e300)};
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d x;
    for (int d = 0; d < 3; ++d) x[d] = (corner >> d & 1 ? box.high : box.low)[d];
    x = rotation * x;
    for (int d = 0; d < 3; ++d) {
      world.low[d] = std::min(world.low[d], x[d]);
      world.high[d] = std::max(world.high[d], x[d]);
    }
  }
  return world;
}

double volume(const Body& body) {
  switch (body.shape) {
    case Shape::box:
      return body.size[0] * body.size[1] * body.size[2];
    case Shape::sphere:
      return 4 * pi / 3 * body.radius * body.radius * body.radius;
    case Shape::cylinder:
      return pi * body.radius * body.radius * body.height;
    case Shape::mesh:
      return sparsegrid::mesh_volume(*body.mesh);
    default:
      throw std::logic_error("volume: not a shape that recipes fill with material");
  }
}

bool shrink(Body& body, double most, double least) {
  const auto excess = [&] { return std::max(1.0, volume(body) / most); };
  if (body.shape == Shape::sphere) body.radius = std::max(body.radius / std::cbrt(excess()), least / 2);
  if (body.shape == Shape::cylinder) {
    body.radius = std::max(body.radius / std::sqrt(excess()), std::min(body.radius, least / 2));
    body.height = std::max(body.height / excess(), std::min(body.height, least));
  }
  if (body.shape == Shape::box) {
    int longest = 0;
    for (int d = 1; d < 3; ++d)
      if (body.size[d] > body.size[longest]) longest = d;
    const double factor = 1 / std::sqrt(excess());
    for (int d = 0; d < 3; ++d)
      if (d != longest) body.size[d] = std::max(body.size[d] * factor, std::min(body.size[d], least));
    body.size[longest] = std::max(body.size[longest] / excess(), least);
  }
  return excess() <= 1 + 1e-9;
}

}  // namespace graupel::mpm
