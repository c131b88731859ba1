// Obstacles as triangles: closed, turned outwards, of the right volume.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "experiments/viewer/body_mesh.h"

namespace graupel::experiments {
namespace {

double volume_of(const TriangleMesh& mesh) {
  double volume = 0;
  for (const auto& t : mesh.triangles) {
    const auto at = [&](int k) { return mesh.vertices[static_cast<std::size_t>(t[static_cast<std::size_t>(k)])]; };
    volume += dot(at(0), cross(at(1), at(2))) / 6;
  }
  return volume;
}

Obstacle body(Shape shape) {
  Obstacle obstacle;
  obstacle.shape = shape;
  obstacle.size = {0.3, 0.2, 0.4};
  obstacle.radius = 0.15;
  obstacle.height = 0.25;
  obstacle.position = {0.4, 0.5, 0.6};
  obstacle.rotation_axis = {1, 1, 0};
  obstacle.rotation_angle = 30;
  return obstacle;
}

TEST(ObstacleMesh, VolumesOfBodies) {
  const double r = 0.15, h = 0.25, pi = std::acos(-1.0), box = 0.3 * 0.2 * 0.4;
  const std::map<Shape, double> expected = {{Shape::box, box},
                                            {Shape::half_box, box / 2},
                                            {Shape::pyramid, 0.3 * 0.4 * h / 3},
                                            {Shape::sphere, 4 * pi / 3 * r * r * r},
                                            {Shape::half_sphere, 2 * pi / 3 * r * r * r},
                                            {Shape::cone, pi / 3 * r * r * h},
                                            {Shape::cylinder, pi * r * r * h}};
  for (const auto& [shape, volume] : expected)
    EXPECT_NEAR(volume_of(body_mesh(Scene(), body(shape))) / volume, 1, 0.006) << static_cast<int>(shape);
}

TEST(ObstacleMesh, APlaneEndsAtTheWalls) {
  Scene scene;
  Obstacle plane = body(Shape::plane);
  const TriangleMesh mesh = body_mesh(scene, plane);
  ASSERT_GE(mesh.triangles.size(), 1u);
  const Vec3d up = plane.rotation() * Vec3d{0, 1, 0};
  for (const Vec3d& x : mesh.vertices) {
    EXPECT_NEAR(dot(x - plane.position, up), 0, 1e-9);
    for (int d = 0; d < 3; ++d) {
      EXPECT_GE(x[d], scene.wall_low()[d] - 1e-9);
      EXPECT_LE(x[d], scene.wall_high()[d] + 1e-9);
    }
  }
  const auto& t = mesh.triangles[0];
  const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
  EXPECT_GT(dot(cross(at(1) - at(0), at(2) - at(0)), up), 0);
}

TEST(ObstacleMesh, LevelSetsBecomeClosedSurfaces) {
  const auto distance = [](const Vec3d& x) { return norm(x - Vec3d{0.1, 0.2, 0.3}) - 0.15; };
  const TriangleMesh mesh = level_set_mesh(distance, {-0.05, 0.05, 0.15}, {0.25, 0.35, 0.45}, 0.01);
  EXPECT_NEAR(volume_of(mesh) / (4.0 / 3 * std::acos(-1.0) * 0.15 * 0.15 * 0.15), 1, 0.01);
  std::map<std::pair<int32_t, int32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  for (const auto& [edge, count] : edges) EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
}

TEST(ObstacleMesh, EdgesStaySharpAndRoundBodiesSmooth) {
  const auto box = shaded_corners(body_mesh(Scene(), body(Shape::box)));
  EXPECT_EQ(box.size(), 36u);
  for (std::size_t i = 0; i < box.size(); ++i)
    for (int d = 0; d < 3; ++d) EXPECT_EQ(box[i].normal[d], box[i - i % 3].normal[d]);
  const Obstacle sphere = body(Shape::sphere);
  for (const SurfaceCorner& corner : shaded_corners(body_mesh(Scene(), sphere))) {
    const Vec3d outward = normalized(corner.position.cast<double>() - sphere.position);
    double along = 0;
    for (int d = 0; d < 3; ++d) along += outward[d] * corner.normal[d] / 127.0;
    EXPECT_GT(along, 0.98);
  }
}

}  // namespace
}  // namespace graupel::experiments
