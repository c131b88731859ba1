// Rollouts of scenes that change on a GPU are those of the CPU's engine, but for products in bf16.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/gpu_only.h"
#include "tests/graph/changing_scene_case.h"
#include "tests/graph/rollout_case.h"

namespace graupel::graph {
namespace {

GnsConfig wide_gns(bool obstacle_particles) {
  GnsConfig config;
  config.message_passing = 3;
  config.obstacle_particles = obstacle_particles;
  config.obstacle_spacing = 1.0 / 32;
  return config;
}

nn::Weights weights_of(const std::string& network) {
  if (network == "gns" || network == "gns_of_points")
    return random_weights(wide_gns(network == "gns_of_points"), wide_statistics());
  HgnConfig config = wide_config(network == "messages" ? Aggregation::messages : Aggregation::activations);
  return random_weights(config, wide_statistics());
}

/// Of the last positions: root mean square of the difference over that of the way since the start.
double relative_difference(const Trajectory& a, const Trajectory& b) {
  double squares = 0, way = 0;
  for (std::size_t i = 0; i < b.particle_count(); ++i) {
    squares += norm2((a.frames.back().position[i] - b.frames.back().position[i]).cast<double>());
    way += norm2((b.frames.back().position[i] - b.frames.front().position[i]).cast<double>());
  }
  return std::sqrt(squares / way);
}

class CudaChangingScenes : public ::testing::TestWithParam<const char*> {
 public:
  /// Both devices go the same way.
  static void expect_parity(const LearnedSimulator& simulator, const ChangingCase& c, int64_t frames,
                            bool free_flight = false) {
    const Environment environment(c.scene);
    const auto history = c.history(static_cast<int>(simulator.config().history) + 1);
    LearnedSimulator::RolloutOptions options;
    options.frames = frames;
    options.schedule = &c.schedule;
    options.free_flight = free_flight;
    const Trajectory expected = simulator.rollout(c.scene, environment, c.type, history, options);
    options.device = Device::cuda;
    const Trajectory actual = simulator.rollout(c.scene, environment, c.type, history, options);
    ASSERT_EQ(actual.frame_count(), expected.frame_count());
    for (std::size_t f = 0; f < expected.frame_count(); ++f)
      EXPECT_EQ(actual.frames[f].active, expected.frames[f].active) << f;
    EXPECT_LT(relative_difference(actual, expected), 0.05);
    EXPECT_EQ(simulator.rollout(c.scene, environment, c.type, history, options).frames.back().position,
              actual.frames.back().position)
        << "the same every time";
  }

 protected:
  LearnedSimulator simulator() const { return file_.read_back(weights_of(GetParam())); }
  WeightsFile file_;
};

TEST_P(CudaChangingScenes, MovingObstacles) {
  GRAUPEL_NEEDS_GPU();
  expect_parity(simulator(), moving_paddle(), 5);
}

TEST_P(CudaChangingScenes, MovingObstaclesWithFreeFlight) {
  GRAUPEL_NEEDS_GPU();
  expect_parity(simulator(), moving_paddle(), 5, /*free_flight=*/true);
}

TEST_P(CudaChangingScenes, EmittersAndSinks) {
  GRAUPEL_NEEDS_GPU();
  expect_parity(simulator(), emitter_over_a_sink(), 8);
}

TEST_P(CudaChangingScenes, PeriodicWalls) {
  GRAUPEL_NEEDS_GPU();
  expect_parity(simulator(), body_across_a_periodic_wall(), 6);
}

TEST_P(CudaChangingScenes, ScriptedParticles) {
  GRAUPEL_NEEDS_GPU();
  expect_parity(simulator(), scripted_particles(0.05), 6);
}

TEST_P(CudaChangingScenes, KinematicParticles) {
  GRAUPEL_NEEDS_GPU();
  ChangingCase c = scripted_particles();
  c.schedule = {};
  for (std::size_t i = 0; i < 8; ++i) c.type[i] = obstacle_particle_type;
  expect_parity(simulator(), c, 5);
}

TEST_P(CudaChangingScenes, OneStepAcrossAPeriodicWall) {
  GRAUPEL_NEEDS_GPU();
  const ChangingCase c = body_across_a_periodic_wall();
  const LearnedSimulator network = simulator();
  const Environment environment(c.scene);
  const auto history = c.history(6);
  EXPECT_LT(difference(network.one_step_on_gpu(c.scene, environment, c.type, history),
                       network.one_step(environment, c.type, history)),
            0.02);
}

/// A static scene after one that changes is what it is alone: the recorded graph is made anew.
TEST_P(CudaChangingScenes, StaticScenesAfterwardsAreTheSame) {
  GRAUPEL_NEEDS_GPU();
  const LearnedSimulator network = simulator();
  const Case still = clouds_at_a_ball(300);
  const Environment environment(still.scene);
  LearnedSimulator::RolloutOptions options;
  options.frames = 5;
  options.device = Device::cuda;
  const Trajectory before = network.rollout(still.scene, environment, still.type, still.history, options);
  expect_parity(network, moving_paddle(), 3);
  const Trajectory after = network.rollout(still.scene, environment, still.type, still.history, options);
  EXPECT_EQ(before.frames.back().position, after.frames.back().position);
}

INSTANTIATE_TEST_SUITE_P(Networks, CudaChangingScenes,
                         ::testing::Values("activations", "messages", "gns", "gns_of_points"),
                         [](const auto& one) { return std::string(one.param); });

/// What comes or goes within a bundle is corrected with the others from the next one on.
TEST(CudaChangingBundles, RolloutsFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  HgnConfig config = wide_config(Aggregation::activations);
  config.bundle = 2;
  const WeightsFile file;
  const LearnedSimulator network = file.read_back(random_weights(config, wide_statistics()));
  for (const bool free_flight : {false, true}) {
    CudaChangingScenes::expect_parity(network, moving_paddle(), 7, free_flight);
    CudaChangingScenes::expect_parity(network, emitter_over_a_sink(), 8, free_flight);
  }
}

TEST(CudaPlane, RolloutsFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  HgnConfig config = wide_config(Aggregation::activations);
  config.dimensions = 2;
  const WeightsFile file;
  const LearnedSimulator network = file.read_back(random_weights(config, wide_statistics()));
  ChangingCase c;
  c.scene.domain.dimensions = 2;
  for (const Vec3f& x : cube({0.5f, 0.5f, 0.5f}, 0.2f, 6))
    c.add({x[0], x[1], static_cast<float>(c.scene.domain.plane())}, {0.3f, 0.1f, 0});
  c.schedule = {};
  const Environment environment(c.scene);
  const auto history = c.history(6);
  LearnedSimulator::RolloutOptions options;
  options.frames = 5;
  const Trajectory expected = network.rollout(c.scene, environment, c.type, history, options);
  options.device = Device::cuda;
  const Trajectory actual = network.rollout(c.scene, environment, c.type, history, options);
  ASSERT_EQ(actual.frame_count(), expected.frame_count());
  EXPECT_LT(relative_difference(actual, expected), 0.05);
  for (const Vec3f& x : actual.frames.back().position) EXPECT_EQ(x[2], static_cast<float>(c.scene.domain.plane()));
}

}  // namespace
}  // namespace graupel::graph
