// Rollouts on a GPU are those of the CPU's engine, but for products in bf16.
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "tests/gpu_only.h"
#include "tests/graph/rollout_case.h"

namespace graupel::graph {
namespace {

class CudaSimulatorTest : public ::testing::TestWithParam<Aggregation> {
 protected:
  LearnedSimulator make(const HgnConfig& config) const {
    return file_.read_back(random_weights(config, wide_statistics()));
  }
  WeightsFile file_;
};

TEST_P(CudaSimulatorTest, AccelerationsAreThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  for (const int particles : {1, 37, 3000, 12000}) {
    const Case c = clouds_at_a_ball(particles);
    const Environment environment(c.scene);
    const LearnedSimulator simulator = make(wide_config(GetParam()));
    const auto expected = simulator.one_step(environment, c.type, c.history);
    const auto actual = simulator.one_step_on_gpu(c.scene, environment, c.type, c.history);
    ASSERT_EQ(actual.size(), expected.size());
    EXPECT_LT(difference(actual, expected), 0.02) << particles;
    EXPECT_EQ(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history), actual) << "the same every time";
  }
}

/// Two materials of one law, and a sticky wall near half of the particles.
TEST_P(CudaSimulatorTest, ConstantsAndContactAreThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  Case c = clouds_at_a_ball(3000);
  for (const char* name : {"a", "b", "c", "d"}) {
    MaterialConfig& material = c.scene.materials[name];
    material.model = MaterialModel::jelly;
    material.youngs_modulus = *name == 'a' ? 3e4 : 9e5;
  }
  c.scene.obstacles[0].friction = 0.5;
  c.scene.domain.faces.x_low = WallConfig{Wall::stick, {}};
  std::vector<int32_t> material;
  for (std::size_t i = 0; i < c.type.size(); ++i)
    material.push_back(i % 7 == 0 ? no_material : static_cast<int>(i % 4));
  const Environment environment(c.scene);
  HgnConfig config = wide_config(GetParam());
  config.material_constants = config.contact = true;
  const LearnedSimulator simulator = make(config);
  const auto expected = simulator.one_step(environment, c.type, c.history, nullptr, material);
  EXPECT_LT(difference(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history, material), expected), 0.02);
  const std::vector<int32_t> one(c.type.size(), 0);
  EXPECT_GT(difference(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history, one), expected), 0.05);
}

TEST_P(CudaSimulatorTest, RolloutsFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const Case c = clouds_at_a_ball(800);
  const Environment environment(c.scene);
  const LearnedSimulator simulator = make(wide_config(GetParam()));
  for (const double density_limit : {0.0, 1.0}) {
    LearnedSimulator::RolloutOptions options;
    options.frames = 8;
    options.free_flight = false;
    options.density_limit = density_limit;
    const Trajectory expected = simulator.rollout(c.scene, environment, c.type, c.history, options);
    options.device = Device::cuda;
    const Trajectory actual = simulator.rollout(c.scene, environment, c.type, c.history, options);
    ASSERT_EQ(actual.frames.size(), expected.frames.size());
    double squares = 0, way = 0;
    for (std::size_t i = 0; i < c.type.size(); ++i) {
      squares += norm2((actual.frames.back().position[i] - expected.frames.back().position[i]).cast<double>());
      way += norm2((expected.frames.back().position[i] - expected.frames.front().position[i]).cast<double>());
    }
    EXPECT_LT(std::sqrt(squares / way), density_limit > 0 ? 0.03 : 0.01);
    for (const Vec3f& x : actual.frames.back().position)
      EXPECT_GT(environment.obstacles.sample(x.cast<double>()).phi, -1e-4);
    EXPECT_EQ(simulator.rollout(c.scene, environment, c.type, c.history, options).frames.back().position,
              actual.frames.back().position)
        << "the same every time";
  }
}

TEST_P(CudaSimulatorTest, CorrectionsWithoutTheNetworkFollowThoseOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const Case c = clouds_at_a_ball(800);
  const Environment environment(c.scene);
  const LearnedSimulator simulator = make(wide_config(GetParam()));
  LearnedSimulator::RolloutOptions options;
  options.frames = 8;
  options.network = false;
  for (const bool corrected : {false, true}) {
    options.project = options.free_flight = corrected;
    options.density_limit = corrected ? 1 : 0;
    options.device = Device::cpu;
    const Trajectory expected = simulator.rollout(c.scene, environment, c.type, c.history, options);
    options.device = Device::cuda;
    const Trajectory actual = simulator.rollout(c.scene, environment, c.type, c.history, options);
    ASSERT_EQ(actual.frames.size(), expected.frames.size());
    for (std::size_t i = 0; i < c.type.size(); ++i)
      ASSERT_LT(norm(actual.frames.back().position[i] - expected.frames.back().position[i]), corrected ? 1e-3f : 1e-5f);
  }
}

TEST_P(CudaSimulatorTest, RolloutsGoOnWhereMatterSpreads) {
  GRAUPEL_NEEDS_GPU();
  // Particles of a small cloud fly apart: many times the cells of the first frame.
  Case c = clouds_at_a_ball(600);
  for (std::size_t t = 0; t < c.history.size(); ++t)
    for (std::size_t i = 0; i < c.type.size(); ++i) {
      const Vec3f start = Vec3f{0.5f, 0.7f, 0.5f} + (c.history[5][i] - Vec3f{0.4f, 0.4f, 0.4f}) * 0.1f;
      c.history[t][i] = start + (start - Vec3f{0.5f, 0.7f, 0.5f}) * (0.4f * static_cast<float>(t));
    }
  const Environment environment(c.scene);
  const LearnedSimulator simulator = make(wide_config(GetParam()));
  LearnedSimulator::RolloutOptions options;
  options.frames = 10;
  options.free_flight = false;
  options.density_limit = 0;
  const Trajectory expected = simulator.rollout(c.scene, environment, c.type, c.history, options);
  options.device = Device::cuda;
  const Trajectory actual = simulator.rollout(c.scene, environment, c.type, c.history, options);
  ASSERT_EQ(actual.frames.size(), expected.frames.size());
  for (std::size_t frame = 0; frame < expected.frames.size(); ++frame)
    for (std::size_t i = 0; i < c.type.size(); ++i)
      ASSERT_LT(norm(actual.frames[frame].position[i] - expected.frames[frame].position[i]), 0.01f) << frame;
  const Trajectory again = simulator.rollout(c.scene, environment, c.type, c.history, options);
  EXPECT_EQ(again.frames.back().position, actual.frames.back().position) << "the same every time";
}

TEST_P(CudaSimulatorTest, RefusesNetworksWithoutKernels) {
  GRAUPEL_NEEDS_GPU();
  HgnConfig config = wide_config(GetParam());
  config.latent = 64;
  const Case c = clouds_at_a_ball(10);
  const Environment environment(c.scene);
  const LearnedSimulator simulator = make(config);
  EXPECT_THROW(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history), ConfigError);
  EXPECT_THROW(simulator.check_runs_on(Device::cuda), ConfigError);
  simulator.check_runs_on(Device::cpu);
}

TEST_P(CudaSimulatorTest, SaysWhereThereIsNoGpu) {
  if (cuda_available()) GTEST_SKIP() << "there is a GPU here";
  const Case c = clouds_at_a_ball(10);
  const Environment environment(c.scene);
  const LearnedSimulator simulator = make(wide_config(GetParam()));
  EXPECT_THROW(simulator.one_step_on_gpu(c.scene, environment, c.type, c.history), ConfigError);
  EXPECT_THROW(simulator.check_runs_on(Device::cuda), ConfigError);
  simulator.check_runs_on(Device::cpu);
}

INSTANTIATE_TEST_SUITE_P(Forms, CudaSimulatorTest, ::testing::Values(Aggregation::messages, Aggregation::activations),
                         [](const auto& form) { return std::string(word_of(form.param)); });

}  // namespace
}  // namespace graupel::graph
