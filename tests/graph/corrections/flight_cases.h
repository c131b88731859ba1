// Particles in flight for tests: clouds, crowds of them, and a snake.
#pragma once

#include <algorithm>
#include <map>
#include <vector>

#include "core/math/random.h"
#include "core/scene/scene.h"

namespace graupel::graph {

inline constexpr int32_t water = 5, sand = 6;

inline Scene box_scene(bool with_obstacle = false) {
  Scene scene;
  scene.domain.dx = 1.0 / 64;
  scene.domain.wall_cells = 2;
  scene.materials["water"].model = MaterialModel::water;
  scene.materials["sand"].model = MaterialModel::sand;
  scene.materials["sand"].density = 1600;
  if (with_obstacle) {
    Obstacle sphere;
    sphere.shape = Shape::sphere;
    sphere.radius = 0.1;
    sphere.position = {0.5, 0.3, 0.5};
    scene.obstacles.push_back(sphere);
  }
  return scene;
}

struct Frame {
  std::vector<Vec3f> before, current, next;
  std::vector<int32_t> type;
};

inline constexpr float cell = 1.0f / 64;

/// A cloud of particles in a cube of 0.06 m, each with a velocity around `velocity` and any acceleration.
inline void add_cloud(Frame& frame, const Scene& scene, const Vec3f& centre, int n, const Vec3f& velocity, int32_t type,
                      uint64_t seed) {
  const Random random(seed, RandomPurpose::test);
  for (int i = 0; i < n; ++i) {
    Vec3f x = centre, v = velocity, a{};
    for (int d = 0; d < 3; ++d) {
      x[d] += static_cast<float>(random.uniform(3 * i, d, -0.03, 0.03));
      v[d] += static_cast<float>(random.uniform(3 * i + 1, d, -0.002, 0.002));
      a[d] = static_cast<float>(random.uniform(3 * i + 2, d, -0.003, 0.003) +
                                scene.gravity[d] * scene.frame_time * scene.frame_time);
    }
    frame.before.push_back(x - v);
    frame.current.push_back(x);
    frame.next.push_back(x + v + a);
    frame.type.push_back(type);
  }
}

/// Whether the groups are the same, by whatever numbers.
inline bool same_groups(const std::vector<int32_t>& a, const std::vector<int32_t>& b) {
  std::map<int32_t, int32_t> there{{-1, -1}}, back{{-1, -1}};
  for (std::size_t i = 0; i < a.size(); ++i)
    if (there.emplace(a[i], b[i]).first->second != b[i] || back.emplace(b[i], a[i]).first->second != a[i]) return false;
  return a.size() == b.size();
}

/// Clouds that fly, meet and touch, in 36 rows; and sprays of single particles.
inline Frame crowd(const Scene& scene) {
  Frame frame;
  for (int k = 0; k < 36; ++k) {
    const auto x = static_cast<float>(k % 6), z = static_cast<float>(k / 6);
    add_cloud(frame, scene, {0.14f + 0.13f * x, 0.1f + 0.02f * static_cast<float>(k), 0.16f + 0.12f * z}, 150,
              {0.03f * (2 - x), 0.01f * z, 0}, k % 2 == 0 ? water : sand, 20 + static_cast<uint64_t>(k));
  }
  for (int k = 0; k < 100; ++k)
    add_cloud(frame, scene,
              {0.15f + 0.07f * static_cast<float>(k % 10), 0.9f, 0.15f + 0.07f * static_cast<float>(k / 10)}, 1 + k % 3,
              {0, 0, 0}, sand, 70 + static_cast<uint64_t>(k));
  return frame;
}

/// A thread of particles that goes to and fro through the domain, three cells between its ways.
inline Frame snake(const Scene& scene, int64_t n) {
  Frame frame;
  const Vec3f gravity = (scene.gravity * (scene.frame_time * scene.frame_time)).cast<float>();
  constexpr float apart = 3 * cell, length = 0.8f;
  constexpr int ways = 16;
  const double all = ways * ways * double{length + apart};
  for (int64_t i = 0; i < n; ++i) {
    const double along = all * static_cast<double>(i) / static_cast<double>(n);
    const auto way = static_cast<int>(along / double{length + apart});
    const auto on_way = static_cast<float>(along - way * double{length + apart});
    const int row = way % ways, layer = way / ways;
    const float x = std::min(on_way, length), turn = std::max(on_way - length, 0.0f);
    const bool back = way % 2 == 1, down = layer % 2 == 1;
    const bool to_next_layer = row == ways - 1;
    const float y = apart * static_cast<float>(down ? ways - 1 - row : row) + (to_next_layer ? 0 : down ? -turn : turn);
    const float z = apart * static_cast<float>(layer) + (to_next_layer ? turn : 0);
    const Vec3f at = {0.1f + (back ? length - x : x), 0.1f + y, 0.1f + z};
    frame.before.push_back(at);
    frame.current.push_back(at);
    frame.next.push_back(at + gravity * (1 + 0.1f * static_cast<float>(i % 7)));
    frame.type.push_back(water);
  }
  return frame;
}

}  // namespace graupel::graph
