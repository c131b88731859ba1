#include "mpm/scene/scene_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/system/error.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::mpm {
namespace {

using testing::HasSubstr;

Scene with_ball(const Vec3d& position) {
  Scene scene = scene_with("water");
  Obstacle ball;
  ball.shape = Shape::sphere;
  ball.radius = 0.05;
  ball.position = position;
  scene.obstacles.push_back(ball);
  return scene;
}

void expect_refusal(const Scene& scene, const std::string& part) {
  try {
    check_obstacles(scene, sparsegrid::ObstacleSet(scene));
    ADD_FAILURE() << "not refused: " << part;
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr(part));
  }
}

TEST(SceneCheck, ObstaclesOutsideTheDomainAreNamed) {
  const Scene inside = with_ball({0.2, 0.2, 0.2}), across = with_ball({-0.04, 0.2, 0.2});
  EXPECT_NO_THROW(check_obstacles(inside, sparsegrid::ObstacleSet(inside)));
  EXPECT_NO_THROW(check_obstacles(across, sparsegrid::ObstacleSet(across)));
  expect_refusal(with_ball({5, 5, 5}), "obstacle 0 (/obstacles/0, sphere) lies outside the domain (position (5, 5, 5)");
  expect_refusal(with_ball({0.2, 1e308, 0.2}), "lies outside the domain");
  EXPECT_THROW(Simulation::create(with_ball({5, 5, 5}), {}), ConfigError);
}

TEST(SceneCheck, ShapesOutsideTheDomainAreToldWithoutLevelSets) {
  const auto is_refused = [](const Scene& scene) {
    try {
      check_shapes_of_obstacles(scene);
      return false;
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), HasSubstr("obstacle 0 (/obstacles/0, "));
      EXPECT_THAT(error.what(), HasSubstr("lies outside the domain (position ("));
      return true;
    }
  };
  EXPECT_TRUE(is_refused(with_ball({5, 5, 5})));
  EXPECT_TRUE(is_refused(with_ball({0.2, 1e308, 0.2})));
  EXPECT_FALSE(is_refused(with_ball({0.2, 0.2, 0.2})));
  EXPECT_FALSE(is_refused(with_ball({-0.04, 0.2, 0.2})));
  Scene scene = with_ball({5, 5, 5});
  scene.obstacles[0].motion = Motion();
  EXPECT_FALSE(is_refused(scene)) << "its motion may lead it in";
  scene = with_ball({0.5, 1.3, 0.5});
  scene.obstacles[0].shape = Shape::box;
  scene.obstacles[0].size = {1, 0.01, 0.01};
  EXPECT_TRUE(is_refused(scene));
  scene.obstacles[0].rotation_axis = {0, 0, 1};
  scene.obstacles[0].rotation_angle = 90;  // upright it reaches in
  EXPECT_FALSE(is_refused(scene));
}

TEST(SceneCheck, ObstaclesThatComeIntoTheDomainMayStartOutside) {
  Scene scene = with_ball({-1, 0.5, 0.5});
  Motion motion;
  motion.velocity = {0.1, 0, 0};  // after the end of a run of 20 frames, which may be a trial
  scene.frames = 20;
  scene.obstacles[0].motion = motion;
  const auto check = [&] { check_obstacles(scene, sparsegrid::ObstacleSet(scene)); };
  EXPECT_NO_THROW(check());
  scene.obstacles[0].motion->velocity = {1e6, 0, 0};  // through it within a moment
  EXPECT_NO_THROW(check());
  scene.obstacles[0].motion->velocity = {0, 1, 0};
  expect_refusal(scene, "lies outside the domain, and its motion does not lead it there (position (-1, 0.5, 0.5)");
  scene.obstacles[0].motion->velocity = {0.1, 0, 0};
  scene.obstacles[0].motion->end_time = 0.5;
  expect_refusal(scene, "its motion does not lead it there");
}

TEST(SceneCheck, KeyframesAndTurnsMayLeadObstaclesIntoTheDomain) {
  Scene scene = with_ball({-1, 0.5, 0.5});
  Motion motion;
  motion.kind = MotionKind::keyframes;
  motion.keyframes = {{0.3, {4, 0, 0}, 0}};  // passes through between its keys
  scene.obstacles[0].motion = motion;
  EXPECT_NO_THROW(check_obstacles(scene, sparsegrid::ObstacleSet(scene)));
  scene.obstacles[0].motion->keyframes = {{0.3, {-4, 0, 0}, 0}};
  expect_refusal(scene, "its motion does not lead it there");
  motion = {};
  motion.spin = 1;
  scene.obstacles[0].motion = motion;  // turns about itself
  expect_refusal(scene, "its motion does not lead it there");
  scene.obstacles[0].motion->center = Vec3d{0, 0.5, 0.5};  // goes round
  EXPECT_NO_THROW(check_obstacles(scene, sparsegrid::ObstacleSet(scene)));
}

TEST(SceneCheck, AMeshOfASourceIsNamedAsOne) {
  Scene scene = scene_with("water");
  Source open = scene.sources[0];
  open.shape = Shape::mesh;
  open.file = "vase.obj";
  open.mesh = [] {
    auto mesh = std::make_shared<TriangleMesh>();
    mesh->vertices = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
    mesh->triangles = {{0, 1, 2}};
    return mesh;
  }();
  scene.sources.push_back(open);
  try {
    Simulation::create(scene, {});
    ADD_FAILURE() << "an open mesh is taken";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("source_1_mesh: the mesh 'vase.obj' is not closed (3 open edges"));
  }
}

}  // namespace
}  // namespace graupel::mpm
