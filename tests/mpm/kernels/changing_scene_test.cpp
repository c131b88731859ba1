// The kernel for small scenes where obstacles move and particles come and go, run on the CPU by fibers: equal to the
// portable kernels, independent of the other scenes, restored byte for byte.
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/gpu/small/small_scene.h"
#include "tests/mpm/changing_scenes.h"
#include "tests/mpm/kernels/small_scene_run.h"

namespace graupel::mpm {
namespace {

constexpr SimulationOptions portable{.seed = 3, .kernels = Kernels::portable};

std::unique_ptr<SmallSolver> after_frames(FiberBackend& backend, const std::vector<Scene>& scenes, int frames) {
  auto small = solver_of(backend, scenes);
  for (int f = 0; f < frames; ++f) small->advance_frame();
  return small;
}

struct Both {
  std::unique_ptr<Simulation> reference;
  std::unique_ptr<SmallSolver> small;
};

/// Some frames of a scene by the portable kernels and by the one for small scenes, which must agree.
Both expect_parity(FiberBackend& backend, const Scene& scene, int frames, const std::string& what) {
  Both both{Simulation::create(scene, portable), solver_of(backend, {scene})};
  for (int f = 0; f < frames; ++f) {
    both.reference->advance_frame();
    both.small->advance_frame();
  }
  const ParticleFrame expected = frame_with_fields(*both.reference, all_fields()),
                      frame = frames_of_scenes(*both.small, all_fields(), frames).front();
  EXPECT_EQ(frame.active, expected.active) << what;
  const Difference d = difference(expected, frame);
  EXPECT_LT(d.position, 2e-5f) << what;
  EXPECT_LT(d.velocity, 2e-2f) << what;
  for (const ParticleField field : {ParticleField::deformation_gradient, ParticleField::plastic}) {
    float worst = 0;
    for (std::size_t i = 0; i < expected.fields[field].size(); ++i)
      worst = std::max(worst, std::abs(expected.fields[field][i] - frame.fields[field][i]));
    EXPECT_LT(worst, 5e-3f) << what << ": " << info_of(field).name;
  }
  const SceneProgress& control = both.small->control(0);
  const RunStatistics statistics = both.reference->statistics();
  int64_t born, removed;
  both.small->setup(0).lifecycle.count(born, removed);
  EXPECT_EQ(control.phase, ScenePhase::frame_done) << what;
  EXPECT_EQ(control.substeps, statistics.substeps) << what;
  EXPECT_EQ(born, statistics.born) << what;
  EXPECT_EQ(removed, statistics.removed) << what;
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(static_cast<double>(control.scripted_momentum[axis]) * momentum_unit,
                statistics.scripted_momentum[axis], 1e-4 * norm(statistics.scripted_momentum) + 1e-9)
        << what;
  const auto pushed = static_cast<double>(statistics.pushed_out);
  EXPECT_NEAR(static_cast<double>(control.pushed_out), pushed, 0.02 * pushed + 3) << what;
  EXPECT_NEAR(control.sound_courant, statistics.sound_courant, 1e-4) << what;
  return both;
}

TEST(ChangingScene, FramesEqualThoseOfThePortableKernels) {
  for (const auto& [name, scene] : changing_scenes()) {
    ASSERT_TRUE(is_changing_scene(scene)) << name;
    FiberBackend backend;
    const Both both = expect_parity(backend, scene, 3, name);
    const RunStatistics statistics = both.reference->statistics();
    EXPECT_TRUE(statistics.pushed_out > 5 || !scene.has_moving_obstacles()) << name;
    EXPECT_TRUE(statistics.born > 20 || scene.emitters.empty()) << name;
    EXPECT_TRUE(statistics.removed > 20 || !scene.has_inactive_particles()) << name;
    // Another motion of the obstacles is seen.
    if (!scene.has_moving_obstacles()) continue;
    Scene at_rest = scene;
    for (Obstacle& obstacle : at_rest.obstacles) obstacle.motion.reset();
    EXPECT_GT(difference(after_frames(backend, {at_rest}, 3)->frame(), both.small->frame()).position, 1e-3f) << name;
  }
}

TEST(ChangingScene, HeldParticlesStandStillAndOtherTransfersAreSeen) {
  FiberBackend backend;
  const Scene scene = gripped_jelly();
  const Both both = expect_parity(backend, scene, 2, "gripped jelly");
  const std::vector<Vec3f> start = after_frames(backend, {scene}, 0)->frame().position;
  const ParticleFrame end = both.small->frame();
  int held = 0;
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (start[i][0] < 0.35f - 1e-6f) {
      ++held;
      EXPECT_EQ(end.position[i], start[i]);
    }
  }
  EXPECT_GT(held, 100);
  EXPECT_GT(norm(both.reference->statistics().scripted_momentum), 1e-3);
  for (const TransferScheme scheme : {TransferScheme::apic, TransferScheme::rpic}) {
    Scene other = scene;
    other.transfer.scheme = scheme;
    EXPECT_GT(difference(after_frames(backend, {other}, 2)->frame(), end).velocity, 1e-2f) << word_of(scheme);
  }
}

TEST(ChangingScene, EveryContactOfAMovingObstacleEqualsThePortableKernels) {
  for (const Contact contact : {Contact::stick, Contact::slip, Contact::separate}) {
    Scene scene = sliding_box();
    for (Obstacle& obstacle : scene.obstacles) obstacle.contact = contact;
    scene.domain.walls = contact;
    FiberBackend backend;
    expect_parity(backend, scene, 2, word_of(contact));
  }
}

TEST(ChangingScene, AMovingPlaneEqualsThePortableKernels) {
  Scene scene = changing_scene("taichi_jelly", {0.5, 0.105, 0.5}, {0, -3, 0});
  Motion motion;
  motion.velocity = {0, 3, 0};
  motion.end_time = 0.005;
  Obstacle plane = moving_box({0.5, 0.077, 0.5}, {1, 1, 1}, motion, 0.1);
  plane.shape = Shape::plane;
  scene.obstacles.push_back(plane);
  FiberBackend backend;
  const Both both = expect_parity(backend, scene, 2, "plane");
  EXPECT_GT(both.reference->statistics().pushed_out, 0);
}

TEST(ChangingScene, StepsOfAFrameHeedScriptsAndEmitters) {
  for (Scene scene : {sliding_box(), emitter_and_sink()}) {
    for (Source& source : scene.sources) source.velocity = {0, 0, 0};
    scene.time_step.policy = StepPolicy::per_frame;
    scene.time_step.substeps_per_frame = 6;
    scene.time_step.courant = 0.05;
    FiberBackend backend;
    const Both both = expect_parity(backend, scene, 1, "per frame");
    EXPECT_GT(both.small->control(0).substeps, 6);
  }
}

TEST(ChangingScene, ParticlesOfAJetFlyFreely) {
  Scene scene = emitter_and_sink();
  scene.gravity = {0, 0, 0};
  scene.sinks.clear();
  scene.sources.clear();
  FiberBackend backend;
  const auto small = after_frames(backend, {scene}, 2);
  const SampledParticles sampled = sample_sources(scene, 3);
  const ParticleFrame frame = frames_of_scenes(*small, {}, 2).front();
  const double now = 2 * scene.frame_time;
  double mass = 0;
  for (std::size_t i = 0; i < sampled.position.size(); ++i) {
    const double age = now - sampled.birth_time[i];
    ASSERT_EQ(frame.is_active(i), age >= 0) << i;
    const Vec3d where = age < 0 ? sampled.position[i] : sampled.position[i] + age * sampled.velocity[i];
    EXPECT_LT(norm(frame.position[i].cast<double>() - where), 1e-5) << i;
    EXPECT_EQ(norm(frame.velocity[i]) > 0, age >= 0) << i;
    if (age >= 0) mass += small->setup(0).material_configs[0].density * sampled.volume[i];
  }
  const SceneSetup<float>& setup = small->setup(0);
  const Diagnostics d = diagnose(small->particles(), setup.material_configs, scene, setup.lifecycle.active());
  EXPECT_GT(mass, 0);
  EXPECT_NEAR(d.mass, mass, 1e-6 * mass);
  EXPECT_NEAR(d.momentum[1], -10 * mass, 1e-5 * mass);
}

TEST(ChangingScene, MomentumOfThoseThatStayIsConservedWhereOthersLeave) {
  // Two bodies that never meet: one leaves through the wall, the other drifts.
  Scene scene = changing_scene("taichi_jelly", {0.92, 0.5, 0.5}, {8, 0, 0});
  add_box(scene, "taichi_jelly", {0.3, 0.5, 0.5}, 0.05);
  scene.sources[1].velocity = {1, 0.5, -0.25};
  scene.sources[1].particles_per_cell = 4;
  scene.gravity = {0, 0, 0};
  scene.domain.faces.x_high = WallConfig{.kind = Wall::open, .friction = {}};
  FiberBackend backend;
  const auto small = after_frames(backend, {scene}, 4);
  int64_t born, removed;
  small->setup(0).lifecycle.count(born, removed);
  const std::vector<int32_t> source = sample_sources(scene, 3).source;
  EXPECT_EQ(removed, std::count(source.begin(), source.end(), 0));
  const SceneSetup<float>& setup = small->setup(0);
  const Diagnostics d = diagnose(small->particles(), setup.material_configs, scene, setup.lifecycle.active());
  EXPECT_NEAR(d.momentum[0], d.mass, 1e-5 * d.mass);
  EXPECT_NEAR(d.momentum[1], 0.5 * d.mass, 1e-5 * d.mass);
  EXPECT_NEAR(d.momentum[2], -0.25 * d.mass, 1e-5 * d.mass);
}

TEST(ChangingScene, ASceneIsTheSameAloneAndAmongOthers) {
  std::vector<Scene> scenes;
  for (const auto& [name, scene] : changing_scenes()) scenes.push_back(scene);
  FiberBackend backend;
  const auto among = after_frames(backend, scenes, 1);
  const std::vector<ParticleFrame> frames = frames_of_scenes(*among, all_fields(), 1);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const auto alone = after_frames(backend, {scenes[i]}, 1);
    const ParticleFrame own = frames_of_scenes(*alone, all_fields(), 1).front();
    EXPECT_EQ(own.active, frames[i].active) << i;
    EXPECT_EQ(own.position, frames[i].position) << i;
    EXPECT_EQ(own.velocity, frames[i].velocity) << i;
    for (const ParticleField field : all_particle_fields) EXPECT_EQ(own.fields[field], frames[i].fields[field]) << i;
  }
}

TEST(ChangingScene, ARestoredRunEqualsAnUninterruptedOneByteForByte) {
  for (const Scene& scene : {turning_paddle(), emitter_and_sink()}) {
    FiberBackend backend;
    const auto whole = after_frames(backend, {scene}, 3), first = after_frames(backend, {scene}, 1),
               fresh = after_frames(backend, {scene}, 0), used = after_frames(backend, {scene}, 2);
    const StateOwner owner{77, SolverKind::gpu_tuned, sizeof(float), whole->first_particle(1)};
    const std::vector<std::byte> state = save_batch(*first, owner, 1);
    for (SmallSolver* solver : {fresh.get(), used.get()}) {
      EXPECT_EQ(load_batch(*solver, owner, state), 1);
      for (int f = 0; f < 2; ++f) solver->advance_frame();
      EXPECT_TRUE(save_batch(*solver, owner, 3) == save_batch(*whole, owner, 3));
    }
  }
}

TEST(ChangingScene, AStateFromBeforeADivergenceGoesOn) {
  Scene scene = turning_paddle();
  scene.sources[0].velocity = {300, 0, 0};
  FiberBackend backend;
  const auto small = solver_of(backend, {scene}), calm = solver_of(backend, {turning_paddle()});
  const StateOwner owner{77, SolverKind::gpu_tuned, sizeof(float), small->first_particle(1)};
  for (int f = 0; f < 2; ++f) small->advance_frame();
  ASSERT_EQ(small->control(0).phase, ScenePhase::diverged);
  calm->advance_frame();
  const std::vector<std::byte> state = save_batch(*calm, owner, 1);
  load_batch(*small, owner, state);
  small->advance_frame();
  EXPECT_EQ(small->control(0).phase, ScenePhase::frame_done);
}

TEST(ChangingScene, AnObstacleThatNeedsOverAMillionStepsAFrameStopsTheScene) {
  Scene scene = sliding_box();
  scene.time_step.policy = StepPolicy::per_frame;
  scene.obstacles[0].motion->velocity = {1e9, 0, 0};
  FiberBackend backend;
  const auto small = after_frames(backend, {scene}, 1);
  EXPECT_EQ(small->control(0).phase, ScenePhase::too_stiff);
  EXPECT_NE(why_stopped(*small, 0, 0).find("over a million steps"), std::string::npos);
}

TEST(ChangingScene, ATooFastObstacleIsRefused) {
  Scene scene = sliding_box();
  scene.obstacles[0].motion->velocity = {100, 0, 0};
  FiberBackend backend;
  EXPECT_THROW(solver_of(backend, {scene}), ConfigError);
}

}  // namespace
}  // namespace graupel::mpm
