// Obstacles that move by a script: they carry, rub, push, and never swallow a particle.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::HasSubstr;

Motion constant(const Vec3d& velocity, double spin = 0, const Vec3d& axis = {0, 1, 0}) {
  Motion motion;
  motion.velocity = velocity;
  motion.spin = spin;
  motion.axis = axis;
  return motion;
}

/// A stiff block that lies on a table.
Scene block_on_table(Contact contact, double friction, const Motion& motion, const Vec3d& at = {0.5, 0.342, 0.5}) {
  Scene scene = scene_with("jelly", at);
  Obstacle table;
  table.size = {0.6, 0.1, 0.6};
  table.position = {0.5, 0.25, 0.5};
  table.contact = contact;
  table.friction = friction;
  table.motion = motion;
  scene.obstacles.push_back(table);
  return scene;
}

Vec3d velocity_after(const Scene& scene, int frames) {
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < frames; ++f) sim->advance_frame();
  const Diagnostics d = sim->diagnostics();
  return d.momentum * (1 / d.mass);
}

TEST(MovingObstacle, AStickyTableCarriesABlockAndASlipperyOneLeavesIt) {
  const auto way_in_half_a_second = [](Contact contact) {
    const auto sim = Simulation::create(block_on_table(contact, 0, constant({0.3, 0, 0})), {});
    for (int f = 0; f < 30; ++f) sim->advance_frame();
    double mean = 0;
    for (const Vec3f& x : sim->frame().position) mean += static_cast<double>(x[0]);
    return mean / static_cast<double>(sim->particle_count()) - 0.5;
  };
  EXPECT_NEAR(way_in_half_a_second(Contact::stick), 0.15, 0.008);  // the block sways a little
  EXPECT_NEAR(way_in_half_a_second(Contact::slip), 0, 2e-3);
  EXPECT_NEAR(way_in_half_a_second(Contact::separate), 0, 2e-3);
}

TEST(MovingObstacle, FrictionSpeedsABlockUpByMuTimesTheNormalImpulseUntilItMovesWithTheTable) {
  const Scene scene = block_on_table(Contact::separate, 0.3, constant({0.4, 0, 0}));
  const Vec3d sliding = velocity_after(scene, 4);
  EXPECT_NEAR(sliding[0], 0.3 * (9.8 * 4 / 60 + sliding[1]), 0.01);
  EXPECT_NEAR(velocity_after(scene, 20)[0], 0.4, 0.02);
}

TEST(MovingObstacle, ATurntableCarriesABlockAround) {
  Scene scene = block_on_table(Contact::stick, 0, constant({0, 0, 0}, 2), {0.65, 0.342, 0.5});
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 24; ++f) sim->advance_frame();  // 0.4 s: 0.8 rad
  Vec3d mean = {0, 0, 0};
  for (const Vec3f& x : sim->frame().position) mean += x.cast<double>();
  mean *= 1.0 / static_cast<double>(sim->particle_count());
  const Vec3d expected = Vec3d{0.5, 0, 0.5} + rotation_about(Vec3d{0, 1, 0}, 0.8) * Vec3d{0.15, 0, 0};
  EXPECT_NEAR(mean[0], expected[0], 0.008);
  EXPECT_NEAR(mean[2], expected[2], 0.008);
}

/// The same sliding seen from the block and from the table.
TEST(MovingObstacle, FrictionKnowsOnlyTheRelativeVelocity) {
  const auto slid = [](double table, double block) {
    Scene scene = block_on_table(Contact::separate, 0.2, constant({table, 0, 0}));
    scene.sources[0].velocity = {block, -0.3, 0};
    return velocity_after(scene, 4)[0];
  };
  const double at_rest = slid(0, -0.8);
  EXPECT_GT(at_rest, -0.7);
  EXPECT_LT(at_rest, -0.3);
  EXPECT_NEAR(slid(0.8, 0) - 0.8, at_rest, 0.01);
  EXPECT_NEAR(slid(0.4, -0.4) - 0.4, at_rest, 0.01);
}

/// A block that a plate hits ends faster than the plate and no faster than after an elastic impact. (The plate takes in
/// the grid's nodes one layer after the other, which costs energy: 0.4 of the relative speed is left, 0.76 where the
/// block flies onto a plate at rest; at half the spacing 0.6 and 0.85.)
TEST(MovingObstacle, APlateHitsABlock) {
  Scene scene = block_on_table(Contact::separate, 0, constant({0, 1, 0}), {0.5, 0.36, 0.5});
  scene.gravity = {0, 0, 0};
  const double v = velocity_after(scene, 6)[1];
  EXPECT_GT(v, 1.2);
  EXPECT_LT(v, 2);
}

/// Deepest particle over all frames in the obstacles where they are at the time, in units of dx.
double deepest_over(const Scene& scene, int frames, int64_t& pushed) {
  const auto sim = Simulation::create(scene, {});
  double deepest = 1;
  for (int f = 0; f < frames; ++f) {
    sim->advance_frame();
    const auto views = sim->obstacles().views_at(sim->time());
    const sparsegrid::ObstacleSetView set = {views.data(), static_cast<int>(views.size())};
    int nearest;
    for (const Vec3f& x : sim->frame().position)
      deepest = std::min(deepest, sparsegrid::signed_distance(set, x.cast<double>(), nearest).phi / scene.domain.dx);
  }
  pushed = sim->statistics().pushed_out;
  return deepest;
}

TEST(MovingObstacle, NoParticleIsEverInsideAPlateThatSweepsOrTurns) {
  int64_t all_pushed = 0;
  for (const bool turns : {false, true}) {
    Scene scene = scene_with("taichi_water", {0.5, 0.12, 0.5}, 0.14);
    Obstacle plate;
    plate.size = {0.03, 0.3, 0.3};
    plate.position = {turns ? 0.62 : 0.35, 0.25, 0.5};
    plate.motion = turns ? constant({-0.3, 0, 0}, 6, {0, 0, 1}) : constant({1.5, 0, 0});
    scene.obstacles.push_back(plate);
    int64_t pushed = 0;
    EXPECT_GT(deepest_over(scene, 12, pushed), -1e-4) << turns;
    all_pushed += pushed;
  }
  EXPECT_GT(all_pushed, 0);
}

TEST(MovingObstacle, AMovingAndAFixedObstacleHoldTogether) {
  Scene scene = scene_with("taichi_sand", {0.5, 0.36, 0.5});
  Obstacle floor, plate;
  floor.size = {0.5, 0.1, 0.5};
  floor.position = {0.5, 0.25, 0.5};
  plate.size = {0.05, 0.2, 0.3};
  plate.position = {0.38, 0.401, 0.5};
  plate.motion = constant({0.8, 0, 0});
  scene.obstacles = {floor, plate};
  int64_t pushed = 0;
  EXPECT_GT(deepest_over(scene, 12, pushed), -1e-4);
}

TEST(MovingObstacle, AnObstacleThatStandsStillEqualsOneWithoutMotion) {
  Scene fixed = block_on_table(Contact::separate, 0.3, constant({0, 0, 0})), scripted = fixed;
  fixed.obstacles[0].motion.reset();
  const Vec3d a = velocity_after(fixed, 8), b = velocity_after(scripted, 8);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(a[d], b[d], 1e-4);
}

TEST(MovingObstacle, KeyframesAndEndsAreKept) {
  Motion motion;
  motion.kind = MotionKind::keyframes;
  motion.keyframes = {{.time = 1, .translation = {0, 2, 0}, .angle = 0},
                      {.time = 3, .translation = {4, 2, 0}, .angle = 720}};
  motion.axis = {0, 0, 2};
  const Vec3d c = {1, 1, 1}, x = {1.5, 1, 1};
  EXPECT_LT(norm(motion.at(0, c)(x) - x), 1e-15);
  EXPECT_LT(norm(motion.at(0.5, c)(x) - (x + Vec3d{0, 1, 0})), 1e-15);
  EXPECT_LT(norm(motion.at(1.25, c)(x) - (c + Vec3d{0.5, 2, 0} + Vec3d{0, 0.5, 0})), 1e-14);  // a quarter turn
  EXPECT_LT(norm(motion.at(9, c)(x) - (x + Vec3d{4, 2, 0})), 1e-14);
  double speed, angular_speed;
  motion.fastest(0, 1, speed, angular_speed);
  EXPECT_NEAR(speed, 2, 1e-15);
  motion.fastest(1.5, 2, speed, angular_speed);
  EXPECT_NEAR(angular_speed, 2 * 3.14159265358979, 1e-12);
  motion.fastest(3.5, 4, speed, angular_speed);
  EXPECT_EQ(speed + angular_speed, 0);

  Motion timed = constant({1, 0, 0});
  timed.start_time = 1;
  timed.end_time = 2;
  EXPECT_EQ(timed.at(0.5, c)(x), x);
  EXPECT_LT(norm(timed.at(5, c)(x) - (x + Vec3d{1, 0, 0})), 1e-15);
}

TEST(MovingObstacle, StepsFollowTheSpeedOfObstaclesAndFixedOnesThatAreTooLongAreRefused) {
  Scene scene = block_on_table(Contact::stick, 0, constant({0, 0, 0}, 200));
  scene.time_step = {.policy = StepPolicy::adaptive, .courant = 0.5, .max_step = 1e-2};
  Scene still = scene;
  still.obstacles[0].motion.reset();
  EXPECT_GT(estimate(scene, {}).substeps, 2 * estimate(still, {}).substeps);
  scene.time_step = {.policy = StepPolicy::fixed, .substeps_per_frame = 54};
  try {
    Simulation::create(scene, {});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("cells in a substep"), HasSubstr("substeps_per_frame")));
  }
}

}  // namespace
}  // namespace graupel::mpm
