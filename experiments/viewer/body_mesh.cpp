#include "experiments/viewer/body_mesh.h"

#include <algorithm>
#include <cmath>

#include "sparsegrid/obstacle_set.h"

namespace graupel::experiments {

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr int segments = 64;  ///< around an axis

struct ProfilePoint {
  double radius, y;
};

/// A profile, from its lower end on the y axis to its upper one, turned about the axis.
TriangleMesh revolved(const std::vector<ProfilePoint>& profile) {
  TriangleMesh mesh;
  for (const ProfilePoint& point : profile)
    for (int s = 0; s < segments; ++s) {
      const double angle = 2 * pi * s / segments;
      mesh.vertices.push_back({point.radius * std::cos(angle), point.y, -point.radius * std::sin(angle)});
    }
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring)
    for (int s = 0; s < segments; ++s) {
      const auto vertex = [&](std::size_t r, int at) { return static_cast<int32_t>(r * segments) + at % segments; };
      const int32_t a = vertex(ring, s), b = vertex(ring, s + 1), c = vertex(ring + 1, s + 1), d = vertex(ring + 1, s);
      if (profile[ring].radius > 0) mesh.triangles.push_back({a, b, c});
      if (profile[ring + 1].radius > 0) mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

std::vector<ProfilePoint> arc(double radius, double from, double to) {
  std::vector<ProfilePoint> profile;
  constexpr int pieces = segments / 2;
  for (int k = 0; k <= pieces; ++k) {
    const double angle = from + (to - from) * k / pieces;
    profile.push_back({k == pieces ? 0 : radius * std::cos(angle), radius * std::sin(angle)});
  }
  return profile;
}

/// Corners low.xz at y_low, and at y_high scaled by `top`: a box, or a pyramid with top 0.
TriangleMesh prism(const Vec3d& size, double y_low, double y_high, double top) {
  TriangleMesh mesh;
  for (const auto& [y, scale] : {std::pair{y_low, 1.0}, std::pair{y_high, top}})
    for (const auto& [x, z] : {std::pair{-1, 1}, std::pair{1, 1}, std::pair{1, -1}, std::pair{-1, -1}})
      mesh.vertices.push_back({0.5 * x * scale * size[0], y, 0.5 * z * scale * size[2]});
  for (int32_t s = 0; s < 4; ++s) {
    const int32_t next = (s + 1) % 4;
    mesh.triangles.push_back({s, next, 4 + next});
    if (top > 0) mesh.triangles.push_back({s, 4 + next, 4 + s});
  }
  mesh.triangles.push_back({0, 2, 1});
  mesh.triangles.push_back({0, 3, 2});
  if (top > 0) {
    mesh.triangles.push_back({4, 5, 6});
    mesh.triangles.push_back({4, 6, 7});
  }
  return mesh;
}

/// The part of a polygon where sign (x[axis] - level) <= 0 (Sutherland and Hodgman 1974).
std::vector<Vec3d> clipped(const std::vector<Vec3d>& polygon, int axis, double level, double sign) {
  std::vector<Vec3d> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double at_a = sign * (a[axis] - level), at_b = sign * (b[axis] - level);
    if (at_a <= 0) kept.push_back(a);
    if ((at_a < 0) != (at_b < 0) && at_a != at_b) kept.push_back(a + (b - a) * (at_a / (at_a - at_b)));
  }
  return kept;
}

/// A half-space's surface between the walls, in the world.
TriangleMesh plane_in_walls(const Scene& scene, const Obstacle& plane) {
  const Vec3d low = scene.wall_low(), high = scene.wall_high(), center = 0.5 * (low + high);
  const Vec3d normal = plane.rotation() * Vec3d{0, 1, 0}, right = plane.rotation() * Vec3d{1, 0, 0};
  const Vec3d up = cross(right, normal), middle = center - normal * dot(center - plane.position, normal);
  const double reach = norm(high - low);
  std::vector<Vec3d> polygon;
  for (const auto& [x, y] : {std::pair{-1, -1}, std::pair{-1, 1}, std::pair{1, 1}, std::pair{1, -1}})
    polygon.push_back(middle + (right * double(x) + up * double(y)) * reach);
  for (int d = 0; d < 3; ++d) polygon = clipped(clipped(polygon, d, low[d], -1), d, high[d], 1);
  TriangleMesh mesh;
  mesh.vertices = polygon;
  for (int32_t k = 2; k < static_cast<int32_t>(polygon.size()); ++k) mesh.triangles.push_back({0, k, k - 1});
  return mesh;
}

TriangleMesh stored_level_set(const Scene& scene, const Obstacle& obstacle) {
  Scene alone = scene;
  alone.obstacles = {obstacle};
  alone.obstacles[0].motion.reset();
  const sparsegrid::ObstacleSet set(alone);
  const auto& frame = set.views_at(0)[0].exact;
  return level_set_mesh([&](const Vec3d& x) { return set.sample(x).phi; }, frame.solid_low, frame.solid_high,
                        scene.voxel());
}

}  // namespace

TriangleMesh body_mesh(const Scene& scene, const Obstacle& obstacle) {
  const double r = obstacle.radius, h = obstacle.height / 2, y = obstacle.size[1] / 2;
  TriangleMesh mesh;
  switch (obstacle.shape) {
    case Shape::box:
      mesh = prism(obstacle.size, -y, y, 1);
      break;
    case Shape::half_box:
      mesh = prism(obstacle.size, -y, 0, 1);
      break;
    case Shape::pyramid:
      mesh = prism(obstacle.size, -h, h, 0);
      break;
    case Shape::sphere:
      mesh = revolved(arc(r, -pi / 2, pi / 2));
      break;
    case Shape::half_sphere: {
      std::vector<ProfilePoint> profile = arc(r, 0, pi / 2);
      profile.insert(profile.begin(), {0, 0});
      mesh = revolved(profile);
      break;
    }
    case Shape::cone:
      mesh = revolved({{0, -h}, {r, -h}, {0, h}});
      break;
    case Shape::cylinder:
      mesh = revolved({{0, -h}, {r, -h}, {r, h}, {0, h}});
      break;
    case Shape::mesh:
      if (obstacle.mesh) mesh = *obstacle.mesh;
      break;
    case Shape::plane:
      return plane_in_walls(scene, obstacle);
    case Shape::vdb:
      return stored_level_set(scene, obstacle);
    case Shape::points:
      break;
  }
  for (Vec3d& x : mesh.vertices) x = obstacle.to_world(x);
  return mesh;
}

std::vector<SurfaceCorner> shaded_corners(const TriangleMesh& mesh) {
  constexpr double smooth = 0.766;  // cos 40 degrees
  std::vector<Vec3d> face(mesh.triangles.size());
  std::vector<std::vector<std::size_t>> around(mesh.vertices.size());
  for (std::size_t t = 0; t < face.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3d& corner = mesh.vertices[static_cast<std::size_t>(a)];
    face[t] =
        cross(mesh.vertices[static_cast<std::size_t>(b)] - corner, mesh.vertices[static_cast<std::size_t>(c)] - corner);
    for (const int32_t v : {a, b, c}) around[static_cast<std::size_t>(v)].push_back(t);
  }
  std::vector<SurfaceCorner> corners;
  corners.reserve(3 * face.size());
  for (std::size_t t = 0; t < face.size(); ++t)
    for (const int32_t v : mesh.triangles[t]) {
      Vec3d sum = Vec3d::zero();  // by area
      for (const std::size_t other : around[static_cast<std::size_t>(v)])
        if (dot(face[t], face[other]) >= smooth * norm(face[t]) * norm(face[other])) sum += face[other];
      const double length = norm(sum);
      SurfaceCorner& corner = corners.emplace_back();
      corner.position = mesh.vertices[static_cast<std::size_t>(v)].cast<float>();
      for (int d = 0; d < 3; ++d)
        corner.normal[d] = static_cast<int8_t>(length > 0 ? std::lround(127 * sum[d] / length) : 0);
    }
  return corners;
}

}  // namespace graupel::experiments
