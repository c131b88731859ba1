// No particle ends a frame inside an obstacle: concave corners, thin plates, fast impacts.
#include <gtest/gtest.h>

#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

Obstacle box_obstacle(const Vec3d& centre, const Vec3d& size, double degrees = 0) {
  Obstacle o;
  o.shape = Shape::box;
  o.size = size;
  o.position = centre;
  o.rotation_axis = {0, 0, 1};
  o.rotation_angle = degrees;
  return o;
}

/// Deepest particle over all frames, in units of dx (negative: inside).
double deepest_over(Simulation& sim, const Scene& scene, int frames) {
  double deepest = 1;
  for (int f = 0; f < frames; ++f) {
    sim.advance_frame();
    for (const Vec3f& x : sim.frame().position)
      deepest = std::min(deepest, sim.obstacles().sample(x.cast<double>()).phi / scene.domain.dx);
  }
  return deepest;
}

TEST(ObstacleScene, NoParticleEntersAConcaveCorner) {
  Scene scene = scene_with("taichi_water", {0.5, 0.36, 0.5});
  add_box(scene, "taichi_sand", {0.5, 0.48, 0.5});
  for (const double side : {-1.0, 1.0})  // a V-shaped trough
    scene.obstacles.push_back(box_obstacle({0.5 + side * 0.15, 0.25, 0.5}, {0.4, 0.1, 0.3}, side * 45));
  for (Source& source : scene.sources) source.velocity = {0, -2, 0};
  const auto sim = Simulation::create(scene, {});
  EXPECT_GT(deepest_over(*sim, scene, 40), -1e-4);
  EXPECT_GT(sim->statistics().pushed_out, 0);
}

TEST(ObstacleScene, AThinPlateHoldsAFastBody) {
  Scene scene = scene_with("taichi_snow", {0.5, 0.5, 0.5});
  scene.materials["taichi_snow"].max_hardening = 5;
  add_box(scene, "taichi_water", {0.4, 0.5, 0.4});
  scene.obstacles.push_back(box_obstacle({0.47, 0.4, 0.47}, {0.4, 0.6 * scene.domain.dx, 0.4}));
  for (Source& source : scene.sources) source.velocity = {0, -5, 0};
  scene.time_step.substeps_per_frame = 108;
  const auto sim = Simulation::create(scene, {});
  EXPECT_GT(deepest_over(*sim, scene, 8), -1e-4);
  int above = 0;
  for (const Vec3f& x : sim->frame().position) {
    if (std::abs(x[0] - 0.47f) > 0.18f || std::abs(x[2] - 0.47f) > 0.18f) continue;  // the splash leaves over the edges
    ASSERT_GT(x[1], 0.4f);                                                           // nothing came through
    ++above;
  }
  EXPECT_GT(above, 100);
}

Scene ball_scene() {
  Scene scene = scene_with("taichi_water", {0.5, 0.5, 0.5});
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {0, -6, 0};
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.1;
  ball.position = {0.5, 0.3, 0.5};
  scene.obstacles.push_back(ball);
  return scene;
}

TEST(ObstacleScene, PushedParticlesAreCountedWithTheMomentumTheyLost) {
  Scene scene = ball_scene();
  const auto sim = Simulation::create(scene, {});
  EXPECT_GT(deepest_over(*sim, scene, 6), -1e-4);
  const RunStatistics s = sim->statistics();
  EXPECT_GT(s.pushed_out, 0);
  EXPECT_GT(s.pushed_out_momentum[1], 0);  // upwards: against the jet

  scene.push_out = false;
  const auto loose = Simulation::create(scene, {});
  EXPECT_LT(deepest_over(*loose, scene, 6), -1e-3);
  EXPECT_EQ(loose->statistics().pushed_out, 0);
}

/// Speed of a jet along and against the top of a box after it hit it, for each contact law.
Vec3d after_hitting_a_box(Contact contact, double friction) {
  Scene scene = scene_with("jelly", {0.4, 0.36, 0.5});
  scene.gravity = {0, 0, 0};
  scene.sources[0].velocity = {3, -1, 0};
  Obstacle box = box_obstacle({0.5, 0.2, 0.5}, {0.6, 0.2, 0.4});
  box.contact = contact;
  box.friction = friction;
  scene.obstacles.push_back(box);
  const auto sim = Simulation::create(scene, {});
  for (int f = 0; f < 5; ++f) sim->advance_frame();
  const Diagnostics d = sim->diagnostics();
  return d.momentum * (1 / d.mass);
}

TEST(ObstacleScene, ObstaclesStickSlipSeparateAndRub) {
  const Vec3d free = after_hitting_a_box(Contact::separate, 0), rough = after_hitting_a_box(Contact::separate, 0.3),
              slip = after_hitting_a_box(Contact::slip, 0), stick = after_hitting_a_box(Contact::stick, 0);
  EXPECT_NEAR(free[0], 3, 0.01);
  EXPECT_GT(free[1], 0.3);
  EXPECT_NEAR(slip[0], 3, 0.01);
  EXPECT_LT(slip[1], free[1]);
  EXPECT_NEAR(rough[0], 3 - 0.3 * (1 + rough[1]), 0.01);  // mu times the normal impulse
  EXPECT_LT(stick[0], 0.9 * rough[0]);
}

}  // namespace
}  // namespace graupel::mpm
