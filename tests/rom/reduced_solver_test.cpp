// Long steps of the reduced solver: a body in free fall whose samples would move over a cell in a step.
#include "rom/reduced_solver.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/system/error.h"
#include "tests/apps/falling_model.h"

namespace graupel::rom {
namespace {

constexpr double gravity = 200;  // [m/s^2]: 13 m/s after four frames, a cell of 1/32 m in 1/427 s
constexpr int frames = 4;

ReducedOptions steps_of(double factor, LongSteps long_steps) {
  ReducedOptions options;
  options.step_factor = factor;
  options.long_steps = long_steps;
  return options;
}

struct Fall {
  Scene scene = io::parse_scene(test::falling_scene(-gravity), "scene", "");
  ReducedModel model = test::falling_model(scene);

  ReducedSolver<double> solver(double factor, LongSteps long_steps) const {
    return {model, mpm::PreparedScene(scene, {.seed = scene.seed}), {35}, steps_of(factor, long_steps)};
  }
};

TEST(LongSteps, AreOfAFactorThatEnds) {
  for (const double factor : {0.0, -1.0, 1e-9, std::numeric_limits<double>::infinity()})
    EXPECT_THROW(Fall().solver(factor, LongSteps::kept), ConfigError) << factor;
}

TEST(LongSteps, FailWhereSamplesMoveOverACell) {
  const Fall fall;
  auto solver = fall.solver(4, LongSteps::kept);
  EXPECT_THROW(
      {
        for (int f = 0; f < frames; ++f) solver.advance_frame();
      },
      DivergedError);
  EXPECT_EQ(solver.statistics().reduced_steps, 0);
}

TEST(LongSteps, AreShortenedAndEndWithinTheErrorOfTheWantedStep) {
  const Fall fall;
  auto solver = fall.solver(4, LongSteps::shortened);
  for (int f = 1; f <= frames; ++f) {
    solver.advance_frame();
    const double time = f * fall.scene.frame_time;
    EXPECT_NEAR(solver.time(), time, 1e-12);
    // Symplectic Euler with steps of at most h is at most g t h / 2 ahead; its velocity is exact.
    const double step = 4 * fall.scene.frame_time / test::falling_steps, fallen = gravity * time * time / 2,
                 way = fall.model.start_latent[0] - solver.state().latent[0];
    EXPECT_GE(way, fallen - 1e-6) << f;
    EXPECT_LE(way, fallen + 1.001 * gravity * time * step / 2) << f;
    EXPECT_NEAR(solver.frame().velocity[0][1], -gravity * time, 0.01 * gravity * time) << f;
  }
  const ReducedStatistics statistics = solver.statistics();
  EXPECT_GT(statistics.reduced_steps, 0);
  EXPECT_LT(statistics.timing.steps, frames * test::falling_steps) << "longer than the training's where that works";
  EXPECT_LE(solver.trust().residual, 1e-3);
}

/// A step that is taken back takes back the load that began in it: its impulse comes once.
TEST(LongSteps, GiveTheScenesLoadsOnce) {
  Fall fall;
  double mass = 0;
  for (const double volume : mpm::sample_sources(fall.scene, fall.scene.seed).volume)
    mass += fall.scene.materials.at("sand").density * volume;
  TimedLoad load;
  load.place = {0.5, 0.75, 0.5};
  load.radius = 9;
  load.force = {0, -20 * mass, 0};  // 20 m/s^2
  load.start = 1.57 * fall.scene.frame_time;
  load.duration = 1;
  fall.scene.loads = {load};
  auto solver = fall.solver(4, LongSteps::shortened);
  for (int f = 0; f < frames; ++f) solver.advance_frame();
  const double time = frames * fall.scene.frame_time;
  EXPECT_GT(solver.statistics().reduced_steps, 0);
  EXPECT_NEAR(solver.frame().velocity[0][1], -gravity * time - 20 * (time - load.start), 1e-3 * gravity * time);
}

TEST(LongSteps, TheTrainingsOwnStepIsNeverShortened) {
  const Fall fall;
  auto own = fall.solver(1, LongSteps::shortened), kept = fall.solver(1, LongSteps::kept);
  for (int f = 0; f < 2; ++f) {
    own.advance_frame();
    kept.advance_frame();
  }
  EXPECT_EQ(own.statistics().reduced_steps, 0);
  EXPECT_EQ(own.state().latent, kept.state().latent);
}

}  // namespace
}  // namespace graupel::rom
