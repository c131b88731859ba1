// What the tests of rollouts on a GPU share: a case with its history, statistics, and weights read back from a file.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "core/math/random.h"
#include "graph/learned_simulator.h"
#include "random_input.h"

namespace graupel::graph {

inline Normalization wide_statistics() {
  Normalization n;
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_std[axis] = 0.01f;
    n.acceleration_std[axis] = 0.001f;
  }
  n.acceleration_mean[1] = -0.0027f;
  return n;
}

struct Case {
  Scene scene;
  std::vector<int32_t> type;
  std::vector<std::vector<Vec3f>> history;
};

inline HgnConfig wide_config(Aggregation aggregation) {
  HgnConfig config;
  config.aggregation = aggregation;
  config.latent = 128;
  config.levels = 4;
  config.message_passing = 3;
  config.signed_distance = true;
  return config;
}

/// Two clouds of particles at an obstacle, some at the walls, each with a velocity of its own [m/frame] beside `drift`.
inline Case clouds_at_a_ball(int particles, double speed = 0.01, const Vec3d& drift = Vec3d::zero()) {
  Case c;
  c.scene = scene_with_ball({0.5, 0.2, 0.5}, 0.15);
  c.scene.name = "clouds";
  const Random random(5, RandomPurpose::test);
  constexpr int32_t ids[] = {5, 6, 8};
  c.history.resize(6);
  for (int i = 0; i < particles; ++i) {
    const auto draw = static_cast<uint64_t>(i);
    const double shift = i % 2 ? 0.05 : 0.45;
    Vec3d x, v;
    for (int d = 0; d < 3; ++d) {
      x[d] = shift + 0.25 * random.uniform(draw, d);
      v[d] = drift[d] + 2 * speed * (random.uniform(1000000 + draw, d) - 0.5);
    }
    c.type.push_back(ids[i % 3]);
    for (int t = 0; t < 6; ++t)
      c.history[static_cast<std::size_t>(t)].push_back((x + v * static_cast<double>(t - 5)).cast<float>());
  }
  return c;
}

/// Of accelerations: root mean square of the difference over that of the deviation from the mean acceleration.
inline double difference(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
  double squares = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (int d = 0; d < 3; ++d) {
      squares += std::pow(a[i][d] - b[i][d], 2);
      size += std::pow(b[i][d] - wide_statistics().acceleration_mean[d], 2);
    }
  return std::sqrt(squares / size);
}

/// Writes weights to a file of its own, which goes with the test.
class WeightsFile {
 public:
  WeightsFile() = default;
  ~WeightsFile() { std::filesystem::remove(path_); }
  WeightsFile(const WeightsFile&) = delete;
  WeightsFile& operator=(const WeightsFile&) = delete;
  LearnedSimulator read_back(const nn::Weights& weights) const {
    nn::write_safetensors(path_, weights);
    return LearnedSimulator(path_);
  }

 private:
  std::string path_ =
      (std::filesystem::temp_directory_path() / ("graupel_rollout_" + std::to_string(::getpid()) + ".safetensors"))
          .string();
};

}  // namespace graupel::graph
