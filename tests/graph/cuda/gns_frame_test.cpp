// Rollouts of GNS on a GPU are those of the CPU's engine, but for products in bf16.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "sparsegrid/radius_graph.h"
#include "tests/gpu_only.h"
#include "tests/graph/rollout_case.h"

namespace graupel::graph {
namespace {

GnsConfig wide_config(bool obstacle_particles) {
  GnsConfig config;
  config.message_passing = 4;
  config.obstacle_particles = obstacle_particles;
  config.obstacle_spacing = 0.02;
  return config;
}

/// A cloud at a ball; it grows by `growth` of its size a frame.
Case make_case(int particles, float growth) {
  Case c;
  c.scene = scene_with_ball({0.5, 0.2, 0.5}, 0.15);
  c.scene.name = "cloud";
  const Vec3f middle{0.5f, 0.45f, 0.5f};
  c.history.resize(6);
  for (const Vec3f& x : blobs(1, particles, 0.12)) {
    constexpr int32_t ids[] = {5, 6, 8};
    c.type.push_back(ids[c.type.size() % 3]);
    for (int t = 0; t < 6; ++t)
      c.history[static_cast<std::size_t>(t)].push_back(middle + (x - blobs(1, 1, 0)[0]) *
                                                                    (1 + growth * static_cast<float>(t - 5)));
  }
  return c;
}

class GnsFrame : public ::testing::Test {
 protected:
  LearnedSimulator make(const nn::Weights& weights) const { return file_.read_back(weights); }
  LearnedSimulator make(const GnsConfig& config) const { return make(random_weights(config, wide_statistics())); }
  WeightsFile file_;
};

/// Sum of squares of the differences over that of the ways.
double relative(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b, const std::vector<Vec3f>& from) {
  double squares = 0, way = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    squares += norm2((a[i] - b[i]).cast<double>());
    way += norm2((b[i] - from[i]).cast<double>());
  }
  return std::sqrt(squares / way);
}

TEST_F(GnsFrame, AccelerationsAreThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const Vec3f mean{0, wide_statistics().acceleration_mean[1], 0};
  for (const bool obstacle_particles : {false, true})
    for (const int particles : {1, 37, 1500}) {
      const LearnedSimulator simulator = make(wide_config(obstacle_particles));
      const Case c = make_case(particles, 0.02f);
      const Environment environment(c.scene);
      const auto expected = simulator.one_step(environment, c.type, c.history);
      const auto actual = simulator.one_step_on_gpu(c.scene, environment, c.type, c.history);
      ASSERT_EQ(actual.size(), expected.size());
      EXPECT_LT(relative(actual, expected, std::vector<Vec3f>(actual.size(), mean)), 0.03) << particles;
      EXPECT_EQ(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history), actual) << "the same every time";
    }
}

TEST_F(GnsFrame, RolloutsFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  for (const bool obstacle_particles : {false, true}) {
    const LearnedSimulator simulator = make(wide_config(obstacle_particles));
    const Case c = make_case(800, 0.02f);
    const Environment environment(c.scene);
    LearnedSimulator::RolloutOptions options;
    options.frames = 8;
    options.free_flight = false;
    options.density_limit = 0;
    const Trajectory expected = simulator.rollout(c.scene, environment, c.type, c.history, options);
    options.device = Device::cuda;
    const Trajectory actual = simulator.rollout(c.scene, environment, c.type, c.history, options);
    ASSERT_EQ(actual.frames.size(), expected.frames.size());
    EXPECT_LT(relative(actual.frames.back().position, expected.frames.back().position, expected.frames[0].position),
              0.02);
    for (const Vec3f& x : actual.frames.back().position)
      EXPECT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-4);
    EXPECT_EQ(simulator.rollout(c.scene, environment, c.type, c.history, options).frames.back().position,
              actual.frames.back().position)
        << "the same every time";
  }
}

TEST_F(GnsFrame, RolloutsGoOnWhereMatterGathers) {
  GRAUPEL_NEEDS_GPU();
  // A cloud falls together without any force: many times the pairs of the first frame.
  nn::Weights weights = random_weights(wide_config(false), Normalization{});
  silence_decoder(weights);
  const LearnedSimulator simulator = make(weights);
  const Case c = make_case(600, -0.1f);
  const Environment environment(c.scene);
  LearnedSimulator::RolloutOptions options;
  options.frames = 8;
  options.free_flight = false;
  options.project = false;
  options.density_limit = 0;
  const Trajectory expected = simulator.rollout(c.scene, environment, c.type, c.history, options);
  const auto pairs = [&](std::size_t frame) {
    return sparsegrid::build_radius_graph(expected.frames[frame].position, 0.035, sparsegrid::SelfEdges::with).edges();
  };
  ASSERT_GT(pairs(8), 4 * pairs(0));
  options.device = Device::cuda;
  const Trajectory actual = simulator.rollout(c.scene, environment, c.type, c.history, options);
  ASSERT_EQ(actual.frames.size(), expected.frames.size());
  for (std::size_t i = 0; i < c.type.size(); ++i)
    ASSERT_LT(norm(actual.frames.back().position[i] - expected.frames.back().position[i]), 1e-5f);
}

TEST_F(GnsFrame, RefusesNetworksWithoutKernels) {
  GRAUPEL_NEEDS_GPU();
  const Case c = make_case(10, 0);
  const Environment environment(c.scene);
  GnsConfig deep = wide_config(false), narrow = wide_config(false);
  deep.hidden_layers = 2;
  narrow.latent = 64;
  for (const GnsConfig& config : {deep, narrow})
    EXPECT_THROW(make(config).one_step_on_gpu(c.scene, environment, c.type, c.history), ConfigError);
}

}  // namespace
}  // namespace graupel::graph
