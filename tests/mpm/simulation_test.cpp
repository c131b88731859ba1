// Laws of whole runs: free fall, conservation, independence of threads, contact with the walls, blow-up.
#include "mpm/simulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::HasSubstr;

void check_free_fall(const std::string& material, Precision precision, double tolerance) {
  Scene scene = scene_with(material, {0.5, 0.6, 0.5});
  scene.sources[0].velocity = {0.5, 1, -0.25};
  const auto sim = Simulation::create(scene, {.precision = precision});
  const Diagnostics start = sim->diagnostics();
  constexpr int frames = 5, n = 54 * frames;
  for (int f = 0; f < frames; ++f) sim->advance_frame();
  const Diagnostics end = sim->diagnostics();
  const double dt = scene.frame_time / 54, g = 9.8, m = start.mass;
  EXPECT_NEAR(end.momentum[0] / m, 0.5, tolerance);
  EXPECT_NEAR(end.momentum[1] / m, 1 - n * g * dt, tolerance);
  EXPECT_NEAR(end.momentum[2] / m, -0.25, tolerance);
  // Symplectic Euler: y_n = y_0 + n v0 dt - g dt^2 n (n + 1) / 2; the mean height is that of the potential energy.
  const double rise = (end.potential_energy - start.potential_energy) / (m * g);
  EXPECT_NEAR(rise, n * dt - g * dt * dt * n * (n + 1) / 2, tolerance);
  EXPECT_LT(end.elastic_energy, tolerance * m);  // F stays I
  EXPECT_NEAR(sim->time(), frames * scene.frame_time, 1e-15);
}

TEST(Simulation, FreeFallIsExactToRounding) {
  for (const char* material : {"water", "jelly", "snow", "sand"}) {
    check_free_fall(material, Precision::f32, 1e-5);
    check_free_fall(material, Precision::f64, 1e-12);
  }
}

TEST(Simulation, FarFrom0SinglePrecisionIsRefused) {
  Scene scene = scene_with("water", {1e5 + 0.5, 0.5, 0.5});
  scene.domain.origin = {1e5, 0, 0};
  try {
    Simulation::create(scene, {});
    ADD_FAILURE() << "nothing was thrown";
  } catch (const ConfigError& error) {
    for (const char* part : {"particle 0", "x = ", "8192", "/domain/origin", "--precision f64"})
      EXPECT_THAT(error.what(), HasSubstr(part));
  }
  EXPECT_NO_THROW(Simulation::create(scene, {.precision = Precision::f64}));
}

TEST(Simulation, ACollisionKeepsMomentumAndAngularMomentum) {
  Scene scene = scene_with("jelly", {0.45, 0.5, 0.5});
  add_box(scene, "snow", {0.56, 0.53, 0.52});
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {2, 0, 0.3};
  scene.sources[1].velocity = {-3, 0.5, 0};
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  const Diagnostics start = sim->diagnostics();
  for (int f = 0; f < 3; ++f) sim->advance_frame();
  const Diagnostics end = sim->diagnostics();
  EXPECT_GT(start.kinetic_energy - end.kinetic_energy, 0.1 * start.kinetic_energy);  // they did meet
  EXPECT_NEAR(end.mass, start.mass, 1e-13);
  EXPECT_LT(norm(end.momentum - start.momentum), 1e-11 * start.mass);
  EXPECT_LT(norm(end.angular_momentum - start.angular_momentum), 1e-11 * start.mass);
}

TEST(Simulation, SpinningJellyNeverGainsEnergy) {
  Scene scene = scene_with("jelly", {0.5, 0.5, 0.5}, 0.15);
  scene.materials["jelly"].youngs_modulus = 1e6;
  scene.gravity = {0, 0, 0};
  // Spin by two halves that start with opposite velocities and stick together.
  scene.sources.clear();
  for (const double side : {-1.0, 1.0}) {
    Source half = box_source("jelly", {0.5 + side * 0.0375, 0.5, 0.5}, {0.075, 0.15, 0.15});
    half.velocity = {0, side, 0};
    scene.sources.push_back(half);
  }
  const auto sim = Simulation::create(scene, {});
  double energy = sim->diagnostics().kinetic_energy;
  const double first = energy;
  for (int f = 0; f < 10; ++f) {
    sim->advance_frame();
    const Diagnostics d = sim->diagnostics();
    EXPECT_LT(d.kinetic_energy + d.elastic_energy, energy * 1.002);
    energy = d.kinetic_energy + d.elastic_energy;
  }
  EXPECT_GT(energy, 0.3 * first);
}

Scene mixed_scene() {
  Scene scene = scene_with("taichi_water", {0.4, 0.12, 0.4});
  add_box(scene, "taichi_sand", {0.47, 0.21, 0.42});
  add_box(scene, "taichi_snow", {0.53, 0.13, 0.43});
  for (Source& source : scene.sources) source.velocity = {0.2, -1.5, 0};
  return scene;
}

TEST(Simulation, OneThreadEqualsTwoByteForByte) {
  const int before = num_threads();
  std::vector<std::byte> state[2];
  for (int threads = 1; threads <= 2; ++threads) {
    set_num_threads(threads);
    const auto sim = Simulation::create(mixed_scene(), {});
    for (int f = 0; f < 4; ++f) sim->advance_frame();
    state[threads - 1] = sim->save_state();
  }
  set_num_threads(before);
  EXPECT_TRUE(state[0] == state[1]);
}

TEST(Simulation, FramesAreInSourceOrderAndStartAtTheSamples) {
  const Scene scene = mixed_scene();
  const auto sim = Simulation::create(scene, {.seed = 5});
  const SampledParticles samples = sample_sources(scene, 5);
  EXPECT_EQ(sim->particle_count(), samples.position.size());
  EXPECT_EQ(sim->particle_type().front(), particle_type_of(MaterialModel::water));
  EXPECT_EQ(sim->particle_type().back(), particle_type_of(MaterialModel::snow));
  const ParticleFrame start = sim->frame();
  for (std::size_t i = 0; i < samples.position.size(); ++i)
    ASSERT_EQ(start.position[i], samples.position[i].cast<float>());
  sim->advance_frame();
  const ParticleFrame next = sim->frame();
  for (std::size_t i = 0; i < samples.position.size(); ++i)
    ASSERT_LT(norm(next.position[i] - start.position[i]), 0.06f);
}

TEST(Simulation, SinglePrecisionStaysCloseToDouble) {
  const Scene scene = mixed_scene();
  const auto single = Simulation::create(scene, {}), twin = Simulation::create(scene, {.precision = Precision::f64});
  for (int f = 0; f < 2; ++f) {
    single->advance_frame();
    twin->advance_frame();
  }
  const ParticleFrame a = single->frame(), b = twin->frame();
  double sum = 0;
  for (std::size_t i = 0; i < a.position.size(); ++i) sum += norm(a.position[i] - b.position[i]);
  EXPECT_LT(sum / static_cast<double>(a.position.size()), 1e-3 * scene.domain.dx);
}

struct Landed {
  Vec3d velocity;  ///< mean [m/s]
  double height;   ///< of the centre of mass [m]
};

/// Jelly 8 frames after it left y = 0.1 with velocity (3, -1, 0), just above the floor.
Landed after_landing(Contact walls, double friction) {
  Scene scene = scene_with("jelly", {0.2, 0.1, 0.5});
  scene.domain.walls = walls;
  scene.domain.wall_friction = friction;
  scene.sources[0].velocity = {3, -1, 0};
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 8; ++f) sim->advance_frame();
  const Diagnostics d = sim->diagnostics();
  return {d.momentum * (1 / d.mass), d.potential_energy / (d.mass * 9.8)};
}

TEST(Simulation, TheWallsStickSlipSeparateAndRub) {
  const Landed free = after_landing(Contact::separate, 0), rough = after_landing(Contact::separate, 0.3),
               slip = after_landing(Contact::slip, 0), stick = after_landing(Contact::stick, 0);
  EXPECT_NEAR(free.velocity[0], 3, 1e-3);
  EXPECT_NEAR(slip.velocity[0], 3, 1e-3);
  // Friction takes mu times the vertical impulse: that of the landing, the bounce and the weight.
  EXPECT_NEAR(rough.velocity[0], 3 - 0.3 * (1 + rough.velocity[1] + 9.8 * 8 / 60), 0.01);
  EXPECT_LT(stick.velocity[0], 0.7 * rough.velocity[0]);
  EXPECT_GT(free.height, slip.height + 0.01);  // the floor holds what it touches instead of letting it bounce
}

TEST(Simulation, ParticlesStayInsideTheWallsAtHighSpeed) {
  Scene scene = scene_with("water", {0.8, 0.5, 0.2});
  scene.sources[0].velocity = {8, -8, -8};
  scene.time_step.substeps_per_frame = 108;
  const auto sim = Simulation::create(scene, {});
  const Vec3f low = scene.wall_low().cast<float>(), high = scene.wall_high().cast<float>();
  for (int f = 0; f < 15; ++f) {
    sim->advance_frame();
    for (const Vec3f& x : sim->frame().position)
      for (int d = 0; d < 3; ++d) {
        ASSERT_GE(x[d], low[d]);
        ASSERT_LE(x[d], high[d]);
      }
  }
  EXPECT_GT(sim->statistics().pushed_out, 0);
}

std::string diverged(const Scene& scene) {
  try {
    const auto sim = Simulation::create(scene, {});
    for (int f = 0; f < 60; ++f) sim->advance_frame();
  } catch (const DivergedError& error) {
    EXPECT_EQ(error.code(), ExitCode::diverged);
    return error.what();
  }
  return "";
}

TEST(Simulation, AFarTooLargeStepIsReportedWithParticleMaterialAndRemedy) {
  for (const char* material : {"taichi_water", "taichi_jelly", "taichi_snow"}) {
    Scene scene = scene_with(material, {0.5, 0.12, 0.5});
    scene.sources[0].velocity = {0, -2, 0};
    scene.time_step.substeps_per_frame = 9;
    EXPECT_THAT(diverged(scene), testing::AllOf(HasSubstr("diverged at particle"), HasSubstr(material),
                                                HasSubstr("substep"), HasSubstr("substeps_per_frame")));
  }
  Scene fast = scene_with("water");
  fast.sources[0].velocity = {100, 0, 0};
  EXPECT_THAT(diverged(fast), HasSubstr("cells in one substep"));
}

TEST(Simulation, AdaptiveStepsKeepTheSoundCourantNumber) {
  Scene scene = mixed_scene();
  scene.time_step = {.policy = StepPolicy::adaptive, .courant = 0.6};
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 2; ++f) sim->advance_frame();
  EXPECT_LT(sim->statistics().sound_courant, 0.75);  // the state that a step makes may be a little stiffer
  EXPECT_EQ(sim->statistics().share_over_courant, 0);
  EXPECT_NEAR(sim->time(), 2 * scene.frame_time, 1e-15);
}

TEST(Simulation, EstimateCountsParticlesNodesAndSubsteps) {
  Scene scene = scene_with("water");
  scene.frames = 10;
  const Estimate e = estimate(scene, {});
  EXPECT_EQ(e.particles, 1074);
  EXPECT_EQ(e.substeps, 540);
  EXPECT_GE(e.grid_nodes, 8 * 8 * 8);
  EXPECT_EQ(e.grid_nodes % 64, 0);
  EXPECT_GT(e.memory_bytes, 1074 * 140);
}

/// Taichi's preset: hardened snow runs far above a sound Courant number of 1 and stays stable.
TEST(Simulation, SlowMixedBlobsOfTheTaichiPresetRunThreeHundredFrames) {
  const auto sim = Simulation::create(mixed_scene(), {});
  for (int f = 0; f < 300; ++f) sim->advance_frame();
  EXPECT_EQ(sim->statistics().substeps, 300 * 54);
  EXPECT_GT(sim->statistics().sound_courant, 1);
  EXPECT_LT(sim->diagnostics().kinetic_energy, 0.01 * sim->diagnostics().mass);
}

}  // namespace
}  // namespace graupel::mpm
