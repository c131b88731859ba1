#include "mpm/scene/source_body.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/system/error.h"
#include "sparsegrid/mesh/mesh_volume.h"

namespace graupel::mpm {

namespace {

constexpr double pi = 3.14159265358979323846;

double analytic_volume(const Body& body) {
  const Vec3d s = body.size;
  const double r = body.radius, h = body.height;
  switch (body.shape) {
    case Shape::box:
      return s[0] * s[1] * s[2];
    case Shape::half_box:
      return s[0] * s[1] * s[2] / 2;
    case Shape::sphere:
      return 4.0 / 3 * pi * r * r * r;
    case Shape::half_sphere:
      return 2.0 / 3 * pi * r * r * r;
    case Shape::cone:
      return pi * r * r * h / 3;
    case Shape::pyramid:
      return s[0] * s[2] * h / 3;
    case Shape::cylinder:
      return pi * r * r * h;
    default:
      return 0;
  }
}

/// The body alone, without its pose, as the one obstacle of a scene.
sparsegrid::ObstacleSet level_set_of(const Source& source, double voxel) {
  Obstacle obstacle;
  static_cast<Body&>(obstacle) = source;
  obstacle.position = {0, 0, 0};
  obstacle.rotation_angle = 0;
  Scene scene;
  scene.obstacle_voxel = voxel;
  scene.obstacle_band = 3 * voxel;
  scene.obstacles.push_back(obstacle);
  return sparsegrid::ObstacleSet(scene);
}

/// An error of level_set_of(), which speaks of an obstacle, as one of the source.
std::string of_source(std::string text, std::size_t index) {
  const std::string name = "obstacle_0_";
  const std::size_t at = text.find(name);
  return at == std::string::npos ? text : text.replace(at, name.size(), fmt::format("source_{}_", index));
}

}  // namespace

double body_volume(const Body& body) {
  return body.shape == Shape::mesh && body.mesh ? sparsegrid::mesh_volume(*body.mesh) : analytic_volume(body);
}

SourceBody::SourceBody(const Source& source, std::size_t index, double voxel) : source_(source) {
  if (source.shape == Shape::plane)
    throw ConfigError(fmt::format("source {} is a plane, which has no volume. Use a box", index));
  if (sparsegrid::is_analytic(source.shape)) {
    bounds_ = sparsegrid::analytic_bounds(source);
    volume_ = analytic_volume(source);
    return;
  }
  try {
    level_set_ = level_set_of(source, voxel);
  } catch (const InputError& error) {
    throw InputError(of_source(error.what(), index));
  } catch (const ConfigError& error) {
    throw ConfigError(of_source(error.what(), index));
  }
  const sparsegrid::GridFacts facts = level_set_.facts(0);
  bounds_ = {facts.world_low, facts.world_high};
  volume_ = source.shape == Shape::mesh ? sparsegrid::mesh_volume(*source.mesh) : level_set_volume();
}

bool SourceBody::contains(const Vec3d& local) const {
  if (sparsegrid::is_analytic(source_.shape)) return sparsegrid::analytic_distance(source_, local) <= 0;
  return level_set_.sample(local).phi <= 0;
}

double SourceBody::level_set_volume() const {
  constexpr int n = 64;  // points along an axis: the error of the volume is about the surface's share of a point
  const Vec3d extent = bounds_.high - bounds_.low;
  int64_t inside = 0;
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z)
        inside += contains(bounds_.low +
                           Vec3d{extent[0] * (x + 0.5) / n, extent[1] * (y + 0.5) / n, extent[2] * (z + 0.5) / n});
  return extent[0] * extent[1] * extent[2] * static_cast<double>(inside) / (double(n) * n * n);
}

}  // namespace graupel::mpm
