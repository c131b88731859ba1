// What the tests of both graph networks put in: random particles in blobs with random features, and sheets that fall on
// a ball.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/math/random.h"
#include "core/scene/scene.h"
#include "random_weights.h"

namespace graupel::graph {

struct Input {
  std::vector<Vec3f> position;
  std::vector<float> features;
  std::vector<int32_t> type;
};

template <typename Config>
Input random_input(const Config& config, int particles, int blob_count = 3, double radius = 0.06) {
  Input input;
  input.position = blobs(blob_count, particles, radius);
  const Random random(5, RandomPurpose::test);
  const auto width = static_cast<std::size_t>(config.input_width() - config.embedding);
  for (std::size_t i = 0; i < input.position.size() * width; ++i)
    input.features.push_back(static_cast<float>(random.uniform(i, 0, -1.5, 1.5)));
  for (std::size_t i = 0; i < input.position.size(); ++i) input.type.push_back(i % 3 == 0 ? 5 : i % 3 == 1 ? 6 : 8);
  return input;
}

/// 0 .. n-1 in random order.
inline std::vector<std::size_t> random_order(std::size_t n) {
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  const Random random(8, RandomPurpose::test);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return random.uniform(a) < random.uniform(b); });
  return order;
}

inline Input in_order(const Input& input, const std::vector<std::size_t>& order) {
  Input shuffled;
  const std::size_t width = input.features.size() / input.position.size();
  for (const std::size_t p : order) {
    shuffled.position.push_back(input.position[p]);
    shuffled.type.push_back(input.type[p]);
    shuffled.features.insert(shuffled.features.end(), input.features.begin() + static_cast<std::ptrdiff_t>(p * width),
                             input.features.begin() + static_cast<std::ptrdiff_t>((p + 1) * width));
  }
  return shuffled;
}

inline double largest(const std::vector<float>& values) {
  double m = 0;
  for (const float v : values) m = std::max(m, static_cast<double>(std::abs(v)));
  return m;
}

inline Scene scene_with_ball(const Vec3d& position, double radius) {
  Scene scene;
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = radius;
  ball.position = position;
  scene.obstacles.push_back(ball);
  return scene;
}

/// 10 x 10 particles above the middle of the unit cube.
inline std::vector<Vec3f> sheet() {
  std::vector<Vec3f> position;
  for (int i = 0; i < 100; ++i)
    position.push_back({0.4f + 0.02f * static_cast<float>(i % 10), 0.7f, 0.4f + 0.02f * static_cast<float>(i / 10)});
  return position;
}

}  // namespace graupel::graph
