// Rollouts on a GPU of networks that predict several frames at once.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/gpu_only.h"
#include "tests/graph/rollout_case.h"

namespace graupel::graph {
namespace {

Trajectory rollout(const LearnedSimulator& simulator, const Case& c, Device device,
                   LearnedSimulator::RolloutOptions options) {
  options.device = device;
  return simulator.rollout(c.scene, Environment(c.scene), c.type, c.history, options);
}

/// The same normalised accelerations for all particles and frames, whatever the graph.
template <typename Config>
nn::Weights constant_bundle(Config config, int64_t bundle) {
  config.bundle = bundle;
  nn::Weights weights = random_weights(config, wide_statistics());
  silence_decoder(weights);
  std::vector<float> bias;
  for (int64_t i = 0; i < 3 * bundle; ++i) bias.push_back(i % 3 == 0 ? 0.4f : i % 3 == 1 ? -0.2f : 0.1f);
  weights.tensors["decoder.layer2.bias"] = nn::Tensor::from_float(bias, {3 * bundle});
  return weights;
}

/// Obstacles, walls and free flight are those of every frame: to the last bit those of a network of one frame.
template <typename Config>
void expect_same_as_frame_by_frame(const Config& config) {
  // Neither cloud grows, so that no run begins a larger graph on its way, and its pressures anew.
  const Case c = clouds_at_a_ball(800, 0, {0.02, -0.02, 0.02});
  LearnedSimulator::RolloutOptions options;
  options.frames = 6;
  options.density_limit = 0;
  const WeightsFile file;
  const Trajectory expected = rollout(file.read_back(constant_bundle(config, 1)), c, Device::cuda, options);
  ASSERT_EQ(expected.frame_count(), 7u);
  for (const int64_t bundle : {2, 4, 8}) {
    const Trajectory actual = rollout(file.read_back(constant_bundle(config, bundle)), c, Device::cuda, options);
    ASSERT_EQ(actual.frame_count(), 7u);
    for (std::size_t f = 0; f <= 6; ++f)
      ASSERT_EQ(actual.frames[f].position, expected.frames[f].position) << "bundle " << bundle << ", frame " << f;
  }
}

void expect_rollouts_of_the_cpu(const LearnedSimulator& simulator) {
  const Case c = clouds_at_a_ball(800);
  const Environment environment(c.scene);
  EXPECT_LT(difference(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history),
                       simulator.one_step(environment, c.type, c.history)),
            0.02);
  LearnedSimulator::RolloutOptions options;
  options.frames = 7;  // cuts the last bundle
  options.free_flight = false;
  const Trajectory expected = rollout(simulator, c, Device::cpu, options);
  const Trajectory actual = rollout(simulator, c, Device::cuda, options);
  ASSERT_EQ(actual.frame_count(), expected.frame_count());
  for (std::size_t f = 1; f < expected.frames.size(); ++f) {
    double squares = 0, way = 0;
    for (std::size_t i = 0; i < c.type.size(); ++i) {
      squares += norm2((actual.frames[f].position[i] - expected.frames[f].position[i]).cast<double>());
      way += norm2((expected.frames[f].position[i] - expected.frames[0].position[i]).cast<double>());
    }
    EXPECT_LT(std::sqrt(squares / way), 0.03) << "bundle " << simulator.config().bundle << ", frame " << f;
  }
  EXPECT_EQ(rollout(simulator, c, Device::cuda, options).frames.back().position, actual.frames.back().position)
      << "the same every time";
}

/// Fast particles among balls and thin plates, so many that look-ups ask lists.
Case shower_among_obstacles() {
  Case c = clouds_at_a_ball(6000, 0.06, {0.01, -0.03, 0.01});
  const Random random(11, RandomPurpose::test);
  for (uint64_t k = 0; k < 30; ++k) {
    Obstacle obstacle;
    obstacle.shape = k % 2 ? Shape::sphere : Shape::box;
    obstacle.radius = 0.04;
    obstacle.size = {0.12, k % 4 ? 0.02 : 0.08, 0.1};
    for (int d = 0; d < 3; ++d) obstacle.position[d] = 0.1 + 0.8 * random.uniform(k, d);
    c.scene.obstacles.push_back(obstacle);
  }
  const Environment environment(c.scene);
  std::vector<std::size_t> free;
  for (std::size_t i = 0; i < c.type.size(); ++i)
    if (environment.obstacles.sample(c.history.back()[i].cast<double>()).phi > 1e-4) free.push_back(i);
  Case kept{c.scene, {}, {}};
  for (const std::size_t i : free) kept.type.push_back(c.type[i]);
  for (const auto& frame : c.history) {
    kept.history.emplace_back();
    for (const std::size_t i : free) kept.history.back().push_back(frame[i]);
  }
  return kept;
}

/// Velocities are those that particles have: what a look-up rounds otherwise shows more in each further frame.
TEST(CudaWays, PastObstaclesAreThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const Case c = shower_among_obstacles();
  LearnedSimulator::RolloutOptions options;
  options.frames = 1;
  options.density_limit = 0;
  options.free_flight = false;
  const WeightsFile file;
  const LearnedSimulator simulator = file.read_back(constant_bundle(wide_config(Aggregation::activations), 1));
  const Trajectory expected = rollout(simulator, c, Device::cpu, options);
  const Trajectory actual = rollout(simulator, c, Device::cuda, options);
  ASSERT_EQ(actual.frame_count(), 2u);
  const Environment environment(c.scene);
  int64_t stopped = 0, apart = 0;
  for (std::size_t i = 0; i < c.type.size(); ++i) {
    const Vec3f &x = actual.frames[1].position[i], &y = expected.frames[1].position[i];
    EXPECT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-6) << i;
    const Vec3f flies = c.history[5][i] + (c.history[5][i] - c.history[4][i]);
    stopped += norm(y - flies) > 0.005f;
    apart += norm(x - y) > 5e-5f;
  }
  EXPECT_GT(stopped, 300);
  EXPECT_LE(apart, stopped / 100) << "of " << stopped;
}

class CudaBundle : public ::testing::TestWithParam<Aggregation> {
 protected:
  WeightsFile file_;
};

TEST_P(CudaBundle, EveryFrameIsCorrectedAsFrameByFrame) {
  GRAUPEL_NEEDS_GPU();
  expect_same_as_frame_by_frame(wide_config(GetParam()));
}

TEST_P(CudaBundle, RolloutsFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  HgnConfig config = wide_config(GetParam());
  for (const int64_t bundle : {2, 3, 8}) {
    config.bundle = bundle;
    expect_rollouts_of_the_cpu(file_.read_back(random_weights(config, wide_statistics())));
  }
}

TEST_P(CudaBundle, StopsAtTheFrameThatBlowsUp) {
  const Case c = clouds_at_a_ball(60);
  nn::Weights weights = constant_bundle(wide_config(GetParam()), 4);
  std::vector<float> bias(12, 0);
  bias[6] = 3000;  // 3 m in the third frame
  weights.tensors["decoder.layer2.bias"] = nn::Tensor::from_float(bias, {12});
  const LearnedSimulator simulator = file_.read_back(weights);
  LearnedSimulator::RolloutOptions options;
  options.frames = 8;
  options.free_flight = false;
  const auto expect_stop = [&](Device device) {
    const Trajectory t = rollout(simulator, c, device, options);
    EXPECT_EQ(t.diverged_at_frame, 3);
    EXPECT_EQ(t.frame_count(), 3u);
  };
  expect_stop(Device::cpu);
  GRAUPEL_NEEDS_GPU();
  expect_stop(Device::cuda);
}

INSTANTIATE_TEST_SUITE_P(Forms, CudaBundle, ::testing::Values(Aggregation::messages, Aggregation::activations),
                         [](const auto& form) { return std::string(word_of(form.param)); });

TEST(GnsBundle, EveryFrameIsCorrectedAsFrameByFrame) {
  GRAUPEL_NEEDS_GPU();
  GnsConfig config;
  config.message_passing = 2;
  expect_same_as_frame_by_frame(config);
}

void expect_gns_of_the_cpu(const GnsConfig& config, const Normalization& statistics) {
  const Case c = clouds_at_a_ball(300);
  const Environment environment(c.scene);
  const WeightsFile file;
  const LearnedSimulator simulator = file.read_back(random_weights(config, statistics));
  EXPECT_LT(difference(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history),
                       simulator.one_step(environment, c.type, c.history)),
            0.03);
  LearnedSimulator::RolloutOptions options;
  options.frames = 3;
  options.free_flight = false;
  options.density_limit = 0;
  const Trajectory expected = rollout(simulator, c, Device::cpu, options);
  const Trajectory actual = rollout(simulator, c, Device::cuda, options);
  ASSERT_EQ(actual.frame_count(), expected.frame_count());
  double squares = 0, way = 0;
  for (std::size_t i = 0; i < c.type.size(); ++i) {
    squares += norm2((actual.frames[3].position[i] - expected.frames[3].position[i]).cast<double>());
    way += norm2((expected.frames[3].position[i] - expected.frames[0].position[i]).cast<double>());
  }
  EXPECT_LT(std::sqrt(squares / way), 0.02);
}

TEST(GnsBundle, AccelerationsAreThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  GnsConfig config;
  config.message_passing = 2;
  config.bundle = 3;
  expect_gns_of_the_cpu(config, wide_statistics());
  config.bundle = 2;
  config.obstacle_particles = true;
  expect_gns_of_the_cpu(config, wide_statistics());
}

}  // namespace
}  // namespace graupel::graph
