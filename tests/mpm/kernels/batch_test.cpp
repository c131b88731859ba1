// The kernels for GPUs, run on the CPU by fibers: equal to the CPU solver, independent of the other scenes in a batch.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>

#include "core/system/error.h"
#include "core/system/fnv1a.h"
#include "mpm/gpu/blocks/batch_results.h"
#include "mpm/gpu/blocks/batch_state.h"
#include "mpm/solver/solver.h"
#include "tests/mpm/kernels/fiber_backend.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

BatchEntry entry_of(const Scene& scene, uint64_t seed) {
  return {scene, sample_sources(scene, seed), sparsegrid::ObstacleSet(scene)};
}

std::vector<BatchEntry> entries_of(const std::vector<Scene>& scenes, uint64_t seed) {
  std::vector<BatchEntry> entries;
  for (const Scene& scene : scenes) entries.push_back(entry_of(scene, seed));
  return entries;
}

void expect_close(const ParticleFrame& a, const ParticleFrame& b, float position, float velocity) {
  ASSERT_EQ(a.position.size(), b.position.size());
  float worst_position = 0, worst_velocity = 0;
  for (std::size_t i = 0; i < a.position.size(); ++i) {
    worst_position = std::max(worst_position, norm(a.position[i] - b.position[i]));
    worst_velocity = std::max(worst_velocity, norm(a.velocity[i] - b.velocity[i]));
  }
  EXPECT_LT(worst_position, position);
  EXPECT_LT(worst_velocity, velocity);
}

/// Runs two frames of both.
void expect_two_close_frames(Simulation& cpu, BatchSolver<FiberBackend>& batch) {
  for (int frame = 0; frame < 2; ++frame) {
    cpu.advance_frame();
    batch.advance_frame();
  }
  expect_close(cpu.frame(), batch.frame(), 2e-5f, 2e-2f);
}

TEST(Batch, TwentySubstepsEqualTheCpuSolver) {
  const Scene scene = four_materials(0.06);
  const auto cpu = Simulation::create(scene, {});
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  expect_two_close_frames(*cpu, batch);
  EXPECT_EQ(batch.control(0).substeps, 40);
  EXPECT_EQ(batch.control(0).phase, ScenePhase::frame_done);
  EXPECT_NEAR(static_cast<double>(batch.control(0).pushed_out), static_cast<double>(cpu->statistics().pushed_out),
              0.02 * static_cast<double>(cpu->statistics().pushed_out) + 2);
}

TEST(Batch, EveryModelMovesAsWithTheCpuSolver) {
  Scene scene = every_model();
  scene.time_step.policy = StepPolicy::fixed;
  scene.time_step.substeps_per_frame = 10;
  scene.frame_time = 10 * 1e-4;
  const auto cpu = Simulation::create(scene, {});
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  cpu->advance_frame();
  batch.advance_frame();
  expect_close(cpu->frame(), batch.frame(), 1e-5f, 2e-2f);
}

TEST(Batch, AdaptiveStepsEqualTheCpuSolver) {
  Scene scene = scene_with("taichi_jelly", {0.5, 0.12, 0.5}, 0.06);
  scene.sources[0].velocity = {0.3, -2, 0};
  scene.time_step.policy = StepPolicy::adaptive;
  const auto cpu = Simulation::create(scene, {});
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  cpu->advance_frame();
  batch.advance_frame();
  expect_close(cpu->frame(), batch.frame(), 2e-5f, 2e-2f);
  EXPECT_EQ(batch.control(0).substeps, cpu->statistics().substeps);
}

TEST(Batch, StepsOfAFrameEqualTheCpuSolver) {
  Scene scene = four_materials(0.06);
  for (Source& source : scene.sources) source.velocity = {0, -8, 0};
  scene.time_step.policy = StepPolicy::per_frame;
  scene.time_step.substeps_per_frame = 6;
  scene.time_step.courant = 0.05;
  const auto cpu = Simulation::create(scene, {});
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  expect_two_close_frames(*cpu, batch);
  EXPECT_GT(batch.control(0).equal_substeps, 6);
  EXPECT_EQ(batch.control(0).substeps, cpu->statistics().substeps);
}

TEST(Batch, ASceneIsTheSameAloneAndAmongOthers) {
  const Scene one = four_materials(0.06);
  Scene fast = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.06);
  fast.sources[0].velocity = {20, 0, 5};  // leaves its blocks' arenas again and again
  fast.time_step.substeps_per_frame = 20;
  fast.frame_time = one.frame_time;
  FiberBackend backend;
  const auto run = [&](const std::vector<Scene>& scenes) {
    std::vector<BatchEntry> entries = entries_of(scenes, 3);
    auto batch = std::make_unique<BatchSolver<FiberBackend>>(backend, std::move(entries));
    batch->advance_frame();
    return batch;
  };
  const auto alone = run({one}), both = run({fast, one});
  const ParticleFrame a = alone->frame(), b = both->frame();
  const auto first = static_cast<std::size_t>(both->first_particle(1));
  for (std::size_t i = 0; i < a.position.size(); ++i) {
    ASSERT_EQ(a.position[i], b.position[first + i]) << i;
    ASSERT_EQ(a.velocity[i], b.velocity[first + i]) << i;
  }
  EXPECT_EQ(both->control(0).substeps, 20);
}

/// Runs five frames at once, and two and three with a state between them, restored into a fresh batch and into one that
/// has run.
void expect_exact_restart(const std::vector<Scene>& scenes) {
  FiberBackend backend;
  const auto make = [&] {
    std::vector<BatchEntry> entries = entries_of(scenes, 3);
    return std::make_unique<BatchSolver<FiberBackend>>(backend, std::move(entries));
  };
  const auto whole = make(), first = make(), fresh = make(), used = make();
  const StateOwner owner{77, SolverKind::gpu_tuned, sizeof(float), whole->first_particle(whole->scene_count())};
  for (int f = 0; f < 5; ++f) whole->advance_frame();
  for (int f = 0; f < 2; ++f) first->advance_frame();
  used->advance_frame();
  const std::vector<std::byte> state = save_batch(*first, owner, 2);
  for (const auto& batch : {fresh.get(), used.get()}) {
    EXPECT_EQ(load_batch(*batch, owner, state), 2);
    EXPECT_TRUE(save_batch(*batch, owner, 2) == state);
    for (int f = 0; f < 3; ++f) batch->advance_frame();
    EXPECT_TRUE(save_batch(*batch, owner, 5) == save_batch(*whole, owner, 5));
    EXPECT_EQ(batch->frame().position, whole->frame().position);
  }
  StateOwner other = owner;
  other.solver = SolverKind::cpu_portable;
  EXPECT_THROW(load_batch(*fresh, other, state), InputError);
  std::vector<std::byte> damaged = state;  // but for its checksum
  const double speed = std::nan("");
  constexpr std::size_t head = 32, frames = sizeof(int64_t);
  std::memcpy(damaged.data() + head + frames + offsetof(SceneProgress, speed), &speed, sizeof(speed));
  const std::size_t content = damaged.size() - sizeof(uint64_t);
  const uint64_t sum = fnv1a(fnv_start, damaged.data(), content);
  std::memcpy(damaged.data() + content, &sum, sizeof(sum));
  EXPECT_THROW(load_batch(*fresh, owner, damaged), InputError);
}

TEST(Batch, ARestoredRunEqualsAnUninterruptedOneByteForByte) {
  Scene slow = scene_with("taichi_sand", {0.36, 0.11, 0.4}, 0.05);
  slow.sources[0].velocity = {0.4, -1.5, 0};
  slow.time_step.substeps_per_frame = 7;
  slow.frame_time = 7 * 3e-4;
  expect_exact_restart({slow});
  Scene fast = scene_with("taichi_snow", {0.5, 0.3, 0.5}, 0.05);  // ends its frames at other times, leaves its arenas
  fast.sources[0].velocity = {20, 0, 5};
  fast.time_step.policy = StepPolicy::adaptive;
  fast.frame_time = 2e-3;
  expect_exact_restart({fast, slow});
}

TEST(Batch, StorageGrowsWhileAFrameRuns) {
  // Four cubes that each fill one block, and half a block later eight of them: more than was reserved at the start.
  Scene scene;
  scene.gravity = {0, 0, 0};
  scene.time_step.policy = StepPolicy::fixed;
  for (const double x : {0.2, 0.4})
    for (const double z : {0.2, 0.6}) {
      const double block = 4 * scene.domain.dx;
      const auto inside = [&](double at) { return (std::floor(at / block) + 0.5) * block + 0.5 * scene.domain.dx; };
      add_box(scene, "taichi_jelly", {inside(x), inside(0.5), inside(z)}, 0.97 * block);
    }
  for (Source& source : scene.sources) source.velocity = {4, 4, 4};
  scene.time_step.substeps_per_frame = 32;
  scene.frame_time = 32 * 3e-4;
  const auto cpu = Simulation::create(scene, {});
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  EXPECT_EQ(batch.active_blocks(), 0);
  batch.advance_frame();
  cpu->advance_frame();
  EXPECT_GE(batch.active_blocks(), 32);
  EXPECT_EQ(batch.control(0).substeps, 32);
  expect_close(cpu->frame(), batch.frame(), 2e-5f, 2e-2f);
}

/// Frames of a batch whose owner blocks all run at once, up to `resident_blocks` of them, or by three kernels (0).
std::unique_ptr<BatchSolver<FiberBackend>> run_batch(FiberBackend& backend, const std::vector<Scene>& scenes,
                                                     int frames) {
  std::vector<BatchEntry> entries = entries_of(scenes, 3);
  auto batch = std::make_unique<BatchSolver<FiberBackend>>(backend, std::move(entries));
  for (int frame = 0; frame < frames; ++frame) batch->advance_frame();
  return batch;
}

void expect_same_bytes(const BatchSolver<FiberBackend>& a, const BatchSolver<FiberBackend>& b) {
  const ParticleFrame x = a.frame(), y = b.frame();
  EXPECT_TRUE(x.position == y.position);
  EXPECT_TRUE(x.velocity == y.velocity);
  for (int i = 0; i < a.scene_count(); ++i) {
    const SceneProgress &c = a.control(i), &d = b.control(i);
    EXPECT_EQ(c.phase, d.phase);
    EXPECT_EQ(c.substeps, d.substeps);
    EXPECT_EQ(c.elapsed, d.elapsed);
    EXPECT_EQ(c.speed, d.speed);
    EXPECT_EQ(c.before_speed, d.before_speed);
    EXPECT_EQ(c.before_sound, d.before_sound);
    EXPECT_EQ(c.sound_courant, d.sound_courant);
    EXPECT_EQ(c.over_courant, d.over_courant);
    EXPECT_EQ(c.pushed_out, d.pushed_out);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(c.pushed_momentum[k], d.pushed_momentum[k]);
    EXPECT_EQ(c.bad_particle, d.bad_particle);
  }
}

TEST(Batch, OneKernelASegmentGivesTheBytesOfThreeASubstep) {
  Scene fast = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.06);
  fast.sources[0].velocity = {20, 0, 5};  // leaves its blocks' arenas again and again
  Scene dense = scene_with("taichi_jelly", {0.5, 0.3, 0.5}, 0.06);
  dense.sources[0].particles_per_cell = 40;  // several rounds of particles a block
  Scene wild = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.04);
  wild.sources[0].velocity = {300, 0, 0};  // diverges
  std::vector<Scene> scenes = {four_materials(0.06), fast, dense, wild};
  for (Scene& scene : scenes) {
    scene.time_step.substeps_per_frame = 20;
    scene.frame_time = 20 * 3e-4;
  }
  FiberBackend resident(128), kernels(0);
  const auto a = run_batch(resident, scenes, 2), b = run_batch(kernels, scenes, 2);
  EXPECT_GT(a->active_blocks(), 0);
  EXPECT_LE(a->active_blocks(), 128);
  expect_same_bytes(*a, *b);
}

TEST(Batch, MoreBlocksThanFitRunAsThreeKernels) {
  FiberBackend few(4), none(0);
  const std::vector<Scene> scenes = {four_materials(0.06)};
  const auto a = run_batch(few, scenes, 1), b = run_batch(none, scenes, 1);
  EXPECT_GT(a->active_blocks(), 4);
  EXPECT_EQ(a->control(0).substeps, 20);
  expect_same_bytes(*a, *b);
}

TEST(Batch, ADivergedSceneStopsAlone) {
  Scene wild = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.04);
  wild.sources[0].velocity = {300, 0, 0};
  wild.time_step.substeps_per_frame = 20;
  Scene calm = wild;
  calm.sources[0].velocity = {0, 0, 0};
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({wild, calm}, 0));
  batch.advance_frame();
  EXPECT_EQ(batch.control(0).phase, ScenePhase::diverged);
  EXPECT_EQ(batch.control(0).bad_particle, 0);
  EXPECT_EQ(batch.control(1).phase, ScenePhase::frame_done);
  EXPECT_EQ(batch.control(1).substeps, 20);
}

TEST(Batch, FramesAndErrorsOfScenesAreThoseOfSingleRuns) {
  Scene wild = scene_with("taichi_water", {0.5, 0.3, 0.5}, 0.04);
  wild.sources[0].velocity = {300, 0, 0};
  Scene calm = scene_with("taichi_snow", {0.5, 0.1, 0.5}, 0.05);
  wild.time_step.substeps_per_frame = calm.time_step.substeps_per_frame = 10;
  FieldSet wanted;
  wanted.add(ParticleField::stress);
  FiberBackend backend;
  BatchSolver<FiberBackend> both(backend, entries_of({calm, wild, calm}, 3));
  BatchSolver<FiberBackend> alone(backend, entries_of({calm}, 3)), wild_alone(backend, entries_of({wild}, 3));
  for (auto* batch : {&both, &alone, &wild_alone}) batch->advance_frame();
  const auto frames = frames_of_scenes(both, wanted, 1), one = frames_of_scenes(alone, wanted, 1);
  for (const std::size_t i : {0u, 2u}) {
    EXPECT_EQ(frames[i].time, calm.frame_time);
    EXPECT_TRUE(frames[i].position == one[0].position);
    EXPECT_TRUE(frames[i].velocity == one[0].velocity);
    EXPECT_TRUE(frames[i].fields == one[0].fields);
    EXPECT_EQ(frames[i].fields[ParticleField::stress].size(), 6 * frames[i].position.size());
  }
  EXPECT_EQ(why_stopped(both, 1, 0), why_stopped(wild_alone, 0, 0));
  EXPECT_NE(why_stopped(both, 1, 0).find("diverged at particle 0 (water"), std::string::npos)
      << why_stopped(both, 1, 0);
}

TEST(Batch, MomentumAndMassAreConserved) {
  Scene scene = scene_with("taichi_jelly", {0.5, 0.5, 0.5}, 0.06);
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {1, -0.5, 0.25};
  scene.time_step.substeps_per_frame = 20;
  scene.frame_time = 20 * 3e-4;
  FiberBackend backend;
  BatchSolver<FiberBackend> batch(backend, entries_of({scene}, 0));
  const Diagnostics before = diagnose(batch.particles(), batch.setup(0).material_configs, scene);
  batch.advance_frame();
  const Diagnostics after = diagnose(batch.particles(), batch.setup(0).material_configs, scene);
  EXPECT_NEAR(after.mass, before.mass, 1e-9 * before.mass);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(after.momentum[d], before.momentum[d], 1e-5 * before.mass) << d;
}

}  // namespace
}  // namespace graupel::mpm
