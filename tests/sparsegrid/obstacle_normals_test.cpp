// Cell normals where obstacles move: they go and turn with the obstacle, those of others stay.
#include "sparsegrid/obstacle_normals.h"

#include <gtest/gtest.h>

#include "core/math/random.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

Motion turn_and_go() {
  Motion motion;
  motion.velocity = {0.3, 0.1, -0.2};
  motion.spin = 2;
  motion.axis = {1, 2, 0.5};
  return motion;
}

Vec3d point(uint64_t i) {
  const Random random(4, RandomPurpose::test);
  return {random.uniform(i, 0), random.uniform(i, 1), random.uniform(i, 2)};
}

TEST(ObstacleNormals, OfRestingObstaclesAreTheCellNormals) {
  const Scene scene = scene_with({make_obstacle(Shape::box, {0.4, 0.4, 0.5}, {0, 1, 1}, 30)}, 1.0 / 32);
  const ObstacleSet set(scene);
  const ObstacleNormals normals(scene, set);
  const CellNormals expected(scene, set);
  EXPECT_EQ(normals.active_cells(), expected.active_cells());
  for (uint64_t i = 0; i < 2000; ++i) EXPECT_EQ(normals.at(point(i)), expected.at(point(i)));
}

TEST(ObstacleNormals, AreCarriedByWhatMoves) {
  Scene scene = scene_with(
      {make_obstacle(Shape::sphere, {0.75, 0.7, 0.7}), make_obstacle(Shape::box, {0.25, 0.3, 0.35})}, 1.0 / 32);
  scene.obstacles[1].motion = turn_and_go();
  const Scene ball = scene_with({scene.obstacles[0]}, 1.0 / 32), box = scene_with({scene.obstacles[1]}, 1.0 / 32);
  const ObstacleNormals start(scene, ObstacleSet(scene)), box_at_start(box, ObstacleSet(box));
  const CellNormals of_ball(ball, ObstacleSet(ball));
  constexpr double time = 0.4;
  const ObstacleNormals later = start.at(time);
  const RigidMap way = scene.obstacles[1].motion->at(time, scene.obstacles[1].position);
  int64_t on_box = 0, on_ball = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = {0.6 * point(i)[0], 0.6 * point(i)[1], 0.6 * point(i)[2]};  // far from the ball
    const Vec3f carried = later.at(way(x)), initial = start.at(x);
    if (norm2(of_ball.at(way(x))) > 0) continue;
    EXPECT_LT(norm(carried.cast<double>() - way.rotation * initial.cast<double>()), 1e-6);
    on_box += norm2(initial) > 0;
    if (norm2(start.at(point(i))) == 0 || norm2(of_ball.at(point(i))) == 0) continue;
    ++on_ball;
    EXPECT_EQ(start.at(point(i)), of_ball.at(point(i)));
  }
  EXPECT_GT(on_box, 500);
  EXPECT_GT(on_ball, 20);
}

/// A body that enters the domain later has its normals there.
TEST(ObstacleNormals, OfWhatStartsOutsideAreWhole) {
  Scene scene = scene_with({make_obstacle(Shape::sphere, {-0.5, 0.5, 0.5})}, 1.0 / 32);
  scene.obstacles[0].motion = Motion{};
  scene.obstacles[0].motion->velocity = {1, 0, 0};
  const ObstacleNormals inside = ObstacleNormals(scene, ObstacleSet(scene)).at(1);
  EXPECT_GT(inside.at({0.5 + 0.14, 0.5 + 0.005, 0.5 + 0.005})[0], 0.9f);
}

TEST(ObstacleNormals, AMovingPlaneHasOneLayer) {
  constexpr double dx = 1.0 / 32;
  Scene scene = scene_with({make_obstacle(Shape::plane, {0.5, 0.3, 0.5})}, dx);
  scene.obstacles[0].motion = Motion{};
  scene.obstacles[0].motion->velocity = {5, 0.1, 0};
  const ObstacleNormals later = ObstacleNormals(scene, ObstacleSet(scene)).at(1);
  const Vec3f up = {0, 1, 0};
  EXPECT_EQ(later.at({0.1, 0.4 + 0.5 * dx, 0.9}), up);
  EXPECT_EQ(later.at({0.1, 0.4 - 0.5 * dx, 0.9}), Vec3f::zero());
  EXPECT_EQ(later.at({0.1, 0.4 + 1.5 * dx, 0.9}), Vec3f::zero());
}

/// Where two have a normal it is the direction of their sum.
TEST(ObstacleNormals, OfTwoInACellAreAdded) {
  Scene scene = scene_with(
      {make_obstacle(Shape::plane, {0.5, 0.3, 0.5}), make_obstacle(Shape::plane, {0.3, 0.5, 0.5}, {0, 0, 1}, -90)},
      1.0 / 32);
  for (Obstacle& obstacle : scene.obstacles) obstacle.motion = Motion{};
  const ObstacleNormals normals(scene, ObstacleSet(scene));
  const Vec3f both = normals.at({0.305, 0.305, 0.5});
  EXPECT_NEAR(both[0], std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(both[1], std::sqrt(0.5), 1e-6);
}

}  // namespace
}  // namespace graupel::sparsegrid
