// Emitters and sinks: how much, where and when; free flight; refusals.
#include "mpm/scene/emission.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::HasSubstr;

constexpr double dx = 1.0 / 64;

Emitter nozzle() {
  Emitter emitter;
  emitter.shape = Shape::box;
  emitter.size = {0.1, 0.02, 0.08};
  emitter.position = {0.5, 0.8, 0.5};
  emitter.material = "water";
  emitter.velocity = {0, -1.2, 0};
  emitter.end_time = 0.25;
  return emitter;
}

Scene with_nozzle(const Emitter& emitter) {
  Scene scene = scene_with("water", {0.2, 0.2, 0.2});
  scene.emitters.push_back(emitter);
  return scene;
}

TEST(Emission, AStreamFillsTheSpaceThatItSweeps) {
  const Emitter emitter = nozzle();
  const EmittedParticles p = sample_emitter(emitter, 0, Domain{}, 1);
  const double volume = 0.1 * 0.08 * 1.2 * 0.25, each = dx * dx * dx / 8;
  // The lattice has whole cells across the stream: 13 x 11 for 12.8 x 10.24.
  EXPECT_NEAR(static_cast<double>(p.time.size()) * each / volume, 13 * 11 / (12.8 * 10.24), 0.02);
  for (std::size_t i = 0; i < p.time.size(); ++i) {
    ASSERT_GE(p.time[i], 0);
    ASSERT_LT(p.time[i], 0.25);
    ASSERT_NEAR(p.position[i][1], 0.79, 0.01 * dx);  // the front of the body
    ASSERT_LE(std::abs(p.position[i][0] - 0.5), 0.05 + 1e-9);
  }
}

TEST(Emission, ARateIsKeptAndOneThatOverlapsIsRefused) {
  Emitter emitter = nozzle();
  emitter.rate = 4000;
  emitter.start_time = 0.05;
  emitter.end_time = 1.05;
  EXPECT_NEAR(static_cast<double>(sample_emitter(emitter, 0, Domain{}, 1).time.size()), 4000, 150);
  emitter.rate = 1e5;
  try {
    sample_emitter(emitter, 2, Domain{}, 1);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("emitter 2"), HasSubstr("overlap"), HasSubstr("at most")));
  }
}

TEST(Emission, AStreamThroughATurnedCylinderKeepsItsSection) {
  Emitter emitter = nozzle();
  emitter.shape = Shape::cylinder;
  emitter.radius = 0.05;
  emitter.height = 0.04;
  emitter.rotation_axis = {0, 0, 1};
  emitter.rotation_angle = 90;
  emitter.velocity = {0.9, 0, 0};
  const EmittedParticles p = sample_emitter(emitter, 0, Domain{}, 1);
  const double each = dx * dx * dx / 8, section = 3.14159 * 0.05 * 0.05;
  EXPECT_NEAR(static_cast<double>(p.time.size()) * each, section * 0.9 * 0.25, 0.08 * section * 0.9 * 0.25);
  for (const Vec3d& x : p.position) {
    ASSERT_LE(std::hypot(x[1] - 0.8, x[2] - 0.5), 0.05 + 1e-9);
    ASSERT_NEAR(x[0], 0.52, 0.01 * dx);
  }
}

/// A jet in free flight is a queue of particles that keep their distances.
TEST(Emission, ParticlesAppearInTimeAndFlyOnWithoutAnyForce) {
  Scene scene = with_nozzle(nozzle());
  scene.gravity = {0, 0, 0};
  const SampledParticles sampled = sample_sources(scene, 0);
  const auto sim = Simulation::create(scene, {.precision = Precision::f64});
  ASSERT_EQ(sim->particle_count(), sampled.position.size());
  for (int f = 0; f < 6; ++f) {
    if (f > 0) sim->advance_frame();
    const ParticleFrame frame = sim->frame();
    for (std::size_t i = 0; i < sampled.position.size(); ++i) {
      const double age = sim->time() - sampled.birth_time[i];
      const bool from_emitter = sampled.source[i] == 1;
      if (from_emitter && std::abs(age) < 1e-9) continue;
      ASSERT_EQ(frame.is_active(i), !from_emitter || age > 0);
      const Vec3d expected =
          from_emitter && age > 0 ? sampled.position[i] + age * sampled.velocity[i] : sampled.position[i];
      ASSERT_LT(norm(frame.position[i].cast<double>() - expected), 1e-6);
      ASSERT_EQ(norm(frame.velocity[i]) > 0, from_emitter && age > 0);
    }
  }
  const Diagnostics d = sim->diagnostics();
  EXPECT_LT(d.elastic_energy, 1e-12);
  EXPECT_GT(sim->statistics().born, 1000);
  EXPECT_LT(sim->statistics().born, static_cast<int64_t>(sim->particle_count()));
}

TEST(Emission, BurstsAppearWholeAndMustNotOverlap) {
  Emitter emitter = nozzle();
  emitter.emission = Emission::burst;
  emitter.shape = Shape::sphere;
  emitter.radius = 0.05;
  emitter.times = {0, 0.1};
  const EmittedParticles p = sample_emitter(emitter, 0, Domain{}, 1);
  const auto first = static_cast<std::size_t>(std::count(p.time.begin(), p.time.end(), 0.0));
  EXPECT_NEAR(static_cast<double>(first) * dx * dx * dx / 8, 4.0 / 3 * 3.14159 * 1.25e-4, 3e-5);
  EXPECT_NEAR(static_cast<double>(p.time.size()), 2 * static_cast<double>(first), 0.06 * static_cast<double>(first));
  const auto sim = Simulation::create(with_nozzle(emitter), {});
  EXPECT_TRUE(sim->frame().is_active(sim->particle_count() - p.time.size()));  // a burst at 0 is there from the start
  EXPECT_FALSE(sim->frame().is_active(sim->particle_count() - 1));

  emitter.times = {0, 0.08};  // 0.096 m for a sphere of 0.1 m
  try {
    sample_emitter(emitter, 0, Domain{}, 1);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(),
                testing::AllOf(HasSubstr("would overlap"), HasSubstr("0.096"), HasSubstr("at least 0.1")));
  }
}

TEST(Emission, MoreParticlesThanTheLimitAreRefused) {
  Emitter emitter = nozzle();
  emitter.particle_limit = 100;
  for (const Emission kind : {Emission::stream, Emission::burst}) {
    emitter.emission = kind;
    emitter.times = {0};
    try {
      Simulation::create(with_nozzle(emitter), {});
      FAIL();
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("emitter 0 (/emitters/0, box of 'water')"),
                                               HasSubstr("particle_limit: 100")));
    }
  }
}

TEST(Emission, AnEmitterOutsideTheWallsIsRefusedByName) {
  Emitter emitter = nozzle();
  emitter.position = {0.5, 1.2, 0.5};
  try {
    Simulation::create(with_nozzle(emitter), {});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("emitter 0"), HasSubstr("outside the walls")));
  }
}

TEST(Emission, EmittersAloneMakeAScene) {
  Scene scene = with_nozzle(nozzle());
  scene.sources.clear();
  const auto sim = Simulation::create(scene, {});
  EXPECT_EQ(sim->diagnostics().mass, 0);
  for (int f = 0; f < 3; ++f) sim->advance_frame();
  EXPECT_GT(sim->diagnostics().mass, 0);
}

TEST(Sinks, RemoveWhatEntersThemForGood) {
  for (const RegionShape shape : {RegionShape::box, RegionShape::sphere, RegionShape::half_space}) {
    Scene scene = scene_with("sand", {0.5, 0.4, 0.5});
    Sink sink;
    sink.shape = shape;
    sink.size = {0.3, 0.1, 0.3};
    sink.radius = 0.15;
    sink.position = {0.5, 0.2, 0.5};
    scene.sinks.push_back(sink);
    const auto sim = Simulation::create(scene, {});
    for (int f = 0; f < 24; ++f) {
      sim->advance_frame();
      const ParticleFrame frame = sim->frame();
      for (std::size_t i = 0; i < frame.position.size(); ++i)
        if (frame.active[i]) {
          ASSERT_FALSE(sink.contains(frame.position[i].cast<double>()));
        }
    }
    EXPECT_EQ(sim->statistics().removed, static_cast<int64_t>(sim->particle_count())) << word_of(shape);
  }
}

TEST(Emission, StepsAreSmallEnoughForStiffMatterFromItsFirstSubstepOn) {
  for (const Emission emission : {Emission::stream, Emission::burst}) {
    Scene scene = scene_with("water", {0.2, 0.2, 0.2});
    scene.time_step = {.policy = StepPolicy::adaptive};
    scene.materials["water"].youngs_modulus = 1e4;
    scene.materials["stiff"] = preset("jelly");
    scene.materials["stiff"].youngs_modulus = 1e8;
    Emitter emitter = nozzle();
    emitter.material = "stiff";
    emitter.emission = emission;
    emitter.start_time = 0.03;
    emitter.end_time = 0.04;
    emitter.times = {0.03};
    scene.emitters.push_back(emitter);
    const auto simulation = Simulation::create(scene, {});
    for (int frame = 0; frame < 3; ++frame) simulation->advance_frame();
    ASSERT_GT(simulation->statistics().born, 0);
    EXPECT_LT(simulation->statistics().sound_courant, 0.75);
  }
}

/// A jet of 100 m/s needs 20 times the steps of a block at rest.
TEST(Emission, StepsAreNotShorterBeforeItBegins) {
  const auto substeps = [](const std::vector<Emitter>& emitters, int frames) {
    Scene scene = scene_with("water", {0.2, 0.2, 0.2});
    scene.time_step = {.policy = StepPolicy::adaptive};
    scene.emitters = emitters;
    const auto simulation = Simulation::create(scene, {});
    for (int frame = 0; frame < frames; ++frame) simulation->advance_frame();
    return simulation->statistics().substeps;
  };
  Emitter jet = nozzle();
  jet.velocity = {0, -100, 0};
  jet.end_time = 0.05;
  jet.start_time = 0.049;
  EXPECT_EQ(substeps({jet}, 1), substeps({}, 1));
  EXPECT_GT(substeps({jet}, 3), 2 * substeps({}, 3));
  jet.emission = Emission::burst;
  jet.times = {0.049};
  EXPECT_EQ(substeps({jet}, 1), substeps({}, 1));
}

/// A nozzle and a box that moves by `way` in the first 0.1 s.
Scene with_moving_box(const Vec3d& from, const Vec3d& way, double start_time) {
  Emitter emitter = nozzle();
  emitter.start_time = start_time;
  Scene scene = with_nozzle(emitter);
  Obstacle box;
  box.shape = Shape::box;
  box.size = {0.2, 0.1, 0.2};
  box.position = from;
  box.motion = Motion{};
  box.motion->velocity = way * 10.0;
  box.motion->end_time = 0.1;
  scene.obstacles.push_back(box);
  return scene;
}

TEST(Emission, EmittersMeetObstaclesWhereTheseAreThen) {
  const Vec3d there = {0.5, 0.8, 0.5}, away = {0.5, 0.5, 0.5};
  EXPECT_NO_THROW(Simulation::create(with_moving_box(there, away - there, 0.15), {}));
  EXPECT_NO_THROW(Simulation::create(with_moving_box(away, there - away, 0), {}));
  for (const Scene& scene : {with_moving_box(there, away - there, 0), with_moving_box(away, there - away, 0.15)}) {
    try {
      Simulation::create(scene, {});
      FAIL() << "not refused";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("emitter 0"), HasSubstr("overlaps obstacle 0")));
      const bool later = scene.emitters[0].start_time > 0;
      EXPECT_THAT(error.what(), HasSubstr(later ? "at 0.15 s, when it begins" : "inside"));
    }
  }
}

}  // namespace
}  // namespace graupel::mpm
