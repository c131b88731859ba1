// Scenes with obstacles for the tests of this folder.
#pragma once

#include <cmath>
#include <string>

#include "core/math/random.h"
#include "core/scene/scene.h"

namespace graupel::sparsegrid {

inline Obstacle make_obstacle(Shape shape, const Vec3d& position, const Vec3d& axis = {0, 1, 0}, double degrees = 0) {
  Obstacle obstacle;
  obstacle.shape = shape;
  obstacle.size = {0.3, 0.22, 0.26};
  obstacle.radius = 0.14;
  obstacle.height = 0.24;
  obstacle.position = position;
  obstacle.rotation_axis = axis;
  obstacle.rotation_angle = degrees;
  return obstacle;
}

inline Scene scene_with(std::vector<Obstacle> obstacles, double dx = 1.0 / 64) {
  Scene scene;
  scene.domain.dx = dx;
  scene.obstacles = std::move(obstacles);
  return scene;
}

constexpr Shape solid_shapes[] = {Shape::box,  Shape::half_box, Shape::sphere,  Shape::half_sphere,
                                  Shape::cone, Shape::pyramid,  Shape::cylinder};

inline std::string word_of(Shape shape) {
  for (const auto& [word, value] : EnumWords<Shape>::words)
    if (value == shape) return word;
  return "?";
}

inline Vec3d random_point(const Random& random, uint64_t i, double low, double high) {
  return {random.uniform(i, 0, low, high), random.uniform(i, 1, low, high), random.uniform(i, 2, low, high)};
}

/// Axis-aligned cube of edge `size` around the origin, as 12 triangles.
inline TriangleMesh cube_mesh(double size) {
  TriangleMesh mesh;
  for (int c = 0; c < 8; ++c)
    mesh.vertices.push_back({(c & 1 ? 0.5 : -0.5) * size, (c & 2 ? 0.5 : -0.5) * size, (c & 4 ? 0.5 : -0.5) * size});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

}  // namespace graupel::sparsegrid
