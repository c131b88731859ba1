// The kernel for small scenes on GPUs, run on the CPU by fibers: equal to the CPU solver, independent of the other
// scenes and of how threads share the particles.
#include <gtest/gtest.h>

#include "mpm/solver/solver.h"
#include "tests/mpm/kernels/small_scene_run.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

/// four_materials() closer together and with few particles, since fibers are slow.
Scene mixed_scene() {
  Scene scene = scene_with("taichi_water", {0.34, 0.08, 0.4}, 0.04);
  add_box(scene, "taichi_sand", {0.43, 0.16, 0.4}, 0.04);
  add_box(scene, "taichi_snow", {0.5, 0.08, 0.43}, 0.04);
  add_box(scene, "taichi_jelly", {0.42, 0.08, 0.48}, 0.04);
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = {0.42, 0.08, 0.4};
  ball.friction = 0.2;
  scene.obstacles.push_back(ball);
  for (Source& source : scene.sources) {
    source.velocity = {0.4, -1.5, 0};
    source.particles_per_cell = 4;
  }
  scene.sources[1].velocity = {0, -6, 0};
  set_steps(scene, 10, 3e-4);
  return scene;
}

/// Runs two frames of both.
void expect_two_close_frames(Simulation& cpu, SmallSolver& small) {
  for (int frame = 0; frame < 2; ++frame) {
    cpu.advance_frame();
    small.advance_frame();
  }
  const Difference d = difference(cpu.frame(), small.frame());
  EXPECT_LT(d.position, 2e-5f);
  EXPECT_LT(d.velocity, 2e-2f);
}

TEST(SmallScene, SubstepsEqualTheCpuSolver) {
  const Scene scene = mixed_scene();
  const auto cpu = Simulation::create(scene, {.seed = 3});
  FiberBackend backend;
  const auto small = solver_of(backend, {scene});
  const ParticleFrame start = small->frame();
  expect_two_close_frames(*cpu, *small);
  EXPECT_GT(difference(start, small->frame()).position, 1e-3f);
  EXPECT_EQ(small->control(0).substeps, 20);
  EXPECT_EQ(small->control(0).phase, ScenePhase::frame_done);
  const auto pushed = static_cast<double>(cpu->statistics().pushed_out);
  EXPECT_GT(pushed, 0);
  EXPECT_NEAR(static_cast<double>(small->control(0).pushed_out), pushed, 0.02 * pushed + 2);
  EXPECT_NEAR(small->control(0).sound_courant, cpu->statistics().sound_courant, 1e-4);
}

TEST(SmallScene, EveryModelMovesAsWithTheCpuSolver) {
  Scene scene = every_model();
  for (Source& source : scene.sources) source.particles_per_cell = 3;
  set_steps(scene, 6, 1e-4);
  const auto cpu = Simulation::create(scene, {.seed = 3});
  FiberBackend backend;
  const auto small = solver_of(backend, {scene});
  cpu->advance_frame();
  small->advance_frame();
  const Difference d = difference(cpu->frame(), small->frame());
  EXPECT_LT(d.position, 1e-5f);
  EXPECT_LT(d.velocity, 2e-2f);
}

TEST(SmallScene, StepsOfAFrameEqualTheCpuSolver) {
  Scene scene = mixed_scene();
  scene.time_step.policy = StepPolicy::per_frame;
  scene.time_step.substeps_per_frame = 6;
  scene.time_step.courant = 0.1;
  ASSERT_TRUE(is_small_scene(scene, 1000));
  const auto cpu = Simulation::create(scene, {.seed = 3});
  FiberBackend backend;
  const auto small = solver_of(backend, {scene});
  expect_two_close_frames(*cpu, *small);
  EXPECT_GT(small->control(0).equal_substeps, 6);
  EXPECT_EQ(small->control(0).substeps, cpu->statistics().substeps);
}

TEST(SmallScene, ASceneIsTheSameAloneAndAmongOthers) {
  // Alone, a warp takes fewer particles at once, and all blocks of threads work for the scene.
  const Scene one = mixed_scene();
  std::vector<Scene> scenes(6, scene_with("taichi_jelly", {0.5, 0.1, 0.5}, 0.05));
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    scenes[i].sources[0].velocity = {0, -double(i), 0};
    set_steps(scenes[i], 10, 3e-4);
  }
  scenes[4] = one;
  FiberBackend backend;
  const auto alone = solver_of(backend, {one}), among = solver_of(backend, scenes);
  for (int frame = 0; frame < 2; ++frame) {
    alone->advance_frame();
    among->advance_frame();
  }
  const auto first = static_cast<std::size_t>(among->first_particle(4));
  const ParticleFrame a = alone->frame(), b = among->frame();
  for (std::size_t i = 0; i < a.position.size(); ++i) {
    ASSERT_EQ(a.position[i], b.position[first + i]) << i;
    ASSERT_EQ(a.velocity[i], b.velocity[first + i]) << i;
  }
}

TEST(SmallScene, ARestoredRunEqualsAnUninterruptedOneByteForByte) {
  Scene scene = scene_with("taichi_sand", {0.36, 0.08, 0.4}, 0.05);
  scene.sources[0].velocity = {0.4, -1.5, 0};
  set_steps(scene, 4, 3e-4);
  FiberBackend backend;
  const auto whole = solver_of(backend, {scene}), first = solver_of(backend, {scene}),
             fresh = solver_of(backend, {scene}), used = solver_of(backend, {scene});
  const StateOwner owner{77, SolverKind::gpu_tuned, sizeof(float), whole->first_particle(1)};
  for (int f = 0; f < 5; ++f) whole->advance_frame();
  for (int f = 0; f < 2; ++f) first->advance_frame();
  used->advance_frame();
  const std::vector<std::byte> state = save_batch(*first, owner, 2);
  for (SmallSolver* solver : {fresh.get(), used.get()}) {
    EXPECT_EQ(load_batch(*solver, owner, state), 2);
    for (int f = 0; f < 3; ++f) solver->advance_frame();
    EXPECT_TRUE(save_batch(*solver, owner, 5) == save_batch(*whole, owner, 5));
  }
}

TEST(SmallScene, ADivergedSceneStopsAlone) {
  Scene wild = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.04);
  wild.sources[0].velocity = {300, 0, 0};
  set_steps(wild, 10, 3e-4);
  Scene calm = wild;
  calm.sources[0].velocity = {0, 0, 0};
  FiberBackend backend;
  const auto small = solver_of(backend, {wild, calm});
  small->advance_frame();
  small->advance_frame();
  EXPECT_EQ(small->control(0).phase, ScenePhase::diverged);
  EXPECT_EQ(small->control(0).bad_particle, 0);
  EXPECT_EQ(small->control(0).substeps, 1);
  EXPECT_EQ(small->control(1).phase, ScenePhase::frame_done);
  EXPECT_EQ(small->control(1).substeps, 20);
}

TEST(SmallScene, MomentumAndMassAreConserved) {
  Scene scene = scene_with("taichi_jelly", {0.5, 0.5, 0.5}, 0.05);
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {1, -0.5, 0.25};
  set_steps(scene, 10, 3e-4);
  FiberBackend backend;
  const auto small = solver_of(backend, {scene});
  const auto judge = [&] { return diagnose(small->particles(), small->setup(0).material_configs, scene); };
  const Diagnostics before = judge();
  for (int frame = 0; frame < 3; ++frame) small->advance_frame();
  const Diagnostics after = judge();
  EXPECT_NEAR(after.mass, before.mass, 1e-9 * before.mass);
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(after.momentum[d], before.momentum[d], 1e-5 * before.mass) << d;
    EXPECT_NEAR(after.angular_momentum[d], before.angular_momentum[d], 1e-5 * before.mass) << d;
  }
}

TEST(SmallScene, TheSceneAloneDecidesWhetherItIsSmall) {
  Scene scene = scene_with("taichi_water");
  EXPECT_TRUE(is_small_scene(scene, 3600));
  EXPECT_FALSE(is_small_scene(scene, most_small_particles + 1));
  scene.domain.dx = scene.domain.size[0] / 512;
  EXPECT_FALSE(is_small_scene(scene, 3600));
  scene = scene_with("taichi_water");
  EXPECT_FALSE(is_changing_scene(scene));
  scene.sinks.push_back({});
  EXPECT_TRUE(is_changing_scene(scene));
  EXPECT_TRUE(is_small_scene(scene, most_changing_particles));
  EXPECT_FALSE(is_small_scene(scene, most_changing_particles + 1));
  scene.time_step.policy = StepPolicy::adaptive;
  EXPECT_FALSE(is_small_scene(scene, 3600));
}

}  // namespace
}  // namespace graupel::mpm
