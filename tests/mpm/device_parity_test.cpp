// The same run on the CPU and on a GPU: sums differ in their order alone, so the drift stays at rounding level.
#include <gtest/gtest.h>

#include "core/error.h"
#include "mpm/simulation.h"
#include "tests/gpu_only.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

TEST(DeviceParity, TwentySubstepsOnTheGpuEqualTheCpu) {
  Scene scene = scene_with("taichi_water", {0.4, 0.11, 0.4});
  add_box(scene, "taichi_sand", {0.47, 0.2, 0.42});
  add_box(scene, "taichi_snow", {0.58, 0.12, 0.43});
  add_box(scene, "taichi_jelly", {0.4, 0.12, 0.5});
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = {0.46, 0.1, 0.4};
  ball.friction = 0.2;
  scene.sources[0].position[0] = 0.36;
  scene.obstacles.push_back(ball);
  for (Source& source : scene.sources) source.velocity = {0.4, -1.5, 0};
  scene.sources[1].position[1] = 0.23;
  scene.time_step.substeps_per_frame = 20;
  scene.frame_time = 20 * 3e-4;
  const auto cpu = Simulation::create(scene, {});
  cpu->advance_frame();
  GRAUPEL_NEEDS_GPU();
  const ParticleFrame a = cpu->frame();
  for (const Kernels kernels : {Kernels::portable, Kernels::tuned}) {
    const auto gpu = Simulation::create(scene, {.device = Device::cuda, .kernels = kernels});
    gpu->advance_frame();
    const ParticleFrame b = gpu->frame();
    float worst_position = 0, worst_velocity = 0;
    for (std::size_t i = 0; i < a.position.size(); ++i) {
      worst_position = std::max(worst_position, norm(a.position[i] - b.position[i]));
      worst_velocity = std::max(worst_velocity, norm(a.velocity[i] - b.velocity[i]));
    }
    EXPECT_LT(worst_position, 1e-5f);
    EXPECT_LT(worst_velocity, 2e-2f);
    EXPECT_EQ(cpu->statistics().substeps, gpu->statistics().substeps);
  }
}

/// The tuned kernels do not know these: Simulation::create takes the portable ones.
TEST(DeviceParity, PlaneAndCubicRunsMoveTheSameOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  Scene space = scene_with("taichi_water", {0.4, 0.11, 0.4});
  add_box(space, "taichi_sand", {0.47, 0.2, 0.42});
  add_box(space, "taichi_snow", {0.58, 0.12, 0.43});
  add_box(space, "taichi_jelly", {0.4, 0.12, 0.5});
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = {0.46, 0.1, 0.5};
  ball.friction = 0.2;
  space.sources[0].position[0] = 0.36;
  space.sources[1].position[1] = 0.23;
  space.obstacles.push_back(ball);
  for (Source& source : space.sources) source.velocity = {0.4, -1.5, 0};
  space.time_step.substeps_per_frame = 20;
  space.frame_time = 20 * 3e-4;
  for (const int dimensions : {2, 3})
    for (const Spline spline : {Spline::quadratic, Spline::cubic}) {
      if (dimensions == 3 && spline == Spline::quadratic) continue;
      Scene scene = dimensions == 2 ? in_the_plane(space) : space;
      scene.transfer.spline = spline;
      const auto cpu = Simulation::create(scene, {}), gpu = Simulation::create(scene, {.device = Device::cuda});
      cpu->advance_frame();
      gpu->advance_frame();
      const ParticleFrame a = cpu->frame(), b = gpu->frame();
      for (std::size_t i = 0; i < a.position.size(); ++i) {
        ASSERT_LT(norm(a.position[i] - b.position[i]), 1e-5f) << dimensions << word_of(spline);
        ASSERT_LT(norm(a.velocity[i] - b.velocity[i]), 2e-2f) << dimensions << word_of(spline);
      }
      EXPECT_EQ(cpu->statistics().substeps, gpu->statistics().substeps);
      EXPECT_THROW(SceneBatch::create({scene}, {0}), ConfigError);
    }
}

TEST(DeviceParity, TunedKernelsGiveTheSameBytesInEveryRun) {
  GRAUPEL_NEEDS_GPU();
  Scene scene = scene_with("taichi_sand", {0.4, 0.11, 0.4});
  scene.frames = 5;
  std::vector<Vec3f> first;
  for (int run = 0; run < 3; ++run) {
    const auto gpu = Simulation::create(scene, {.device = Device::cuda});
    for (int f = 0; f < 5; ++f) gpu->advance_frame();
    const ParticleFrame frame = gpu->frame();
    if (run == 0) first = frame.position;
    EXPECT_TRUE(first == frame.position);
  }
}

TEST(DeviceParity, EveryModelMovesTheSameOnTheGpu) {
  Scene scene = every_model();
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = 20;
  scene.frame_time = 20 * 1e-4;
  const auto cpu = Simulation::create(scene, {});
  cpu->advance_frame();
  GRAUPEL_NEEDS_GPU();
  const ParticleFrame a = cpu->frame();
  for (const Kernels kernels : {Kernels::portable, Kernels::tuned}) {
    const auto gpu = Simulation::create(scene, {.device = Device::cuda, .kernels = kernels});
    gpu->advance_frame();
    const ParticleFrame b = gpu->frame();
    for (std::size_t i = 0; i < a.position.size(); ++i) {
      ASSERT_LT(norm(a.position[i] - b.position[i]), 1e-5f) << particle_type_name(cpu->particle_type()[i]);
      ASSERT_LT(norm(a.velocity[i] - b.velocity[i]), 2e-2f) << particle_type_name(cpu->particle_type()[i]);
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
