#include "graph/features/features.h"

#include <gtest/gtest.h>

#include <functional>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "random_input.h"

namespace graupel::graph {
namespace {

Normalization made_normalization() {
  Normalization n;
  for (int axis = 0; axis < 3; ++axis) {
    n.velocity_mean[axis] = 0.001f * static_cast<float>(axis);
    n.velocity_std[axis] = 0.01f * static_cast<float>(axis + 1);
  }
  return n;
}

TEST(Features, LayoutAndValuesOfAKnownCase) {
  FeatureConfig config;
  config.history = 2;
  config.signed_distance = true;
  config.wall_clamp = 0.3;
  const Environment environment(scene_with_ball({0.5, 0.5, 0.5}, 0.2));
  const Vec3f x = {0.5f, 0.73f, 0.5f};  // 0.03 above the ball
  const std::vector<std::vector<Vec3f>> positions = {
      {x - Vec3f{0.03f, 0, 0}, {0, 0, 0}}, {x - Vec3f{0.02f, 0.01f, 0}, {0, 0, 0}}, {x, {0.05f, 0.5f, 0.9f}}};
  const Normalization normalization = made_normalization();
  const std::vector<float> f = particle_features(config, normalization, environment, positions);
  const int width = 2 * 3 + 3 + 6 + 4;
  ASSERT_EQ(f.size(), 2u * width);
  // velocities, newest first
  EXPECT_NEAR(f[0], 0.02 / 0.01, 1e-4);
  EXPECT_NEAR(f[1], (0.01 - 0.001) / 0.02, 1e-4);
  EXPECT_NEAR(f[2], -0.002 / 0.03, 1e-4);
  EXPECT_NEAR(f[3], 0.01 / 0.01, 1e-4);
  EXPECT_NEAR(f[4], (-0.01 - 0.001) / 0.02, 1e-4);
  EXPECT_NEAR(f[5], -0.002 / 0.03, 1e-4);
  // no surface in this cell: no normal
  for (int i = 6; i < 9; ++i) EXPECT_EQ(f[static_cast<std::size_t>(i)], 0);
  // lower x y z, upper x y z, clamped to 0.3
  const double walls[] = {1, 1, 1, 1, 0.27 / 0.3, 1};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(f[9 + i], walls[i], 1e-5) << i;
  // distance over the clamp of 0.1, and its gradient
  EXPECT_NEAR(f[15], 0.3, 0.02);
  EXPECT_NEAR(f[16], 0, 0.05);
  EXPECT_NEAR(f[17], 1, 0.01);
  EXPECT_NEAR(f[18], 0, 0.05);
  // the second particle: far from the ball, near two walls
  const float* g = f.data() + width;
  EXPECT_NEAR(g[9], 0.05 / 0.3, 1e-5);
  EXPECT_NEAR(g[14], 0.1 / 0.3, 1e-5);
  EXPECT_EQ(g[15], 1);
  for (int i = 16; i < 19; ++i) EXPECT_EQ(g[i], 0);
}

TEST(Features, CellNormalIsTheOneOfTheParticlesCell) {
  FeatureConfig config;
  config.history = 1;
  const Environment environment(scene_with_ball({0.5, 0.5, 0.5}, 0.2));
  const Vec3f x = {0.5f, 0.702f, 0.5f};  // the cell that the top of the ball passes through
  const std::vector<float> f = particle_features(config, {}, environment, {{x}, {x}});
  ASSERT_EQ(f.size(), 12u);
  const Vec3f normal = environment.normals.at(x.cast<double>());
  EXPECT_GT(std::abs(normal[1]), 0.9f);
  for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(f[static_cast<std::size_t>(3 + axis)], normal[axis]);
  config.cell_normal = false;
  EXPECT_EQ(particle_features(config, {}, environment, {{x}, {x}}).size(), 9u);
}

TEST(Features, OutsideTheDomainDistancesAreNegativeAndWithoutObstaclesFar) {
  FeatureConfig config;
  config.history = 1;
  config.cell_normal = false;
  config.signed_distance = true;
  Scene scene;
  scene.domain.origin = {-1, 0, 0};
  scene.domain.size = {2, 1, 1};
  const Environment environment(scene);
  const Vec3f x = {-1.07f, 0.5f, 5.0f};
  const std::vector<float> f = particle_features(config, {}, environment, {{x}, {x}});
  ASSERT_EQ(f.size(), 13u);
  EXPECT_NEAR(f[3], -0.07 / 0.28, 1e-5);
  EXPECT_EQ(f[6], 1);
  EXPECT_EQ(f[5], 1);
  EXPECT_EQ(f[8], -1);
  EXPECT_EQ(f[9], 1);
  EXPECT_EQ(f[10], 0);
}

TEST(Features, WrongNumberOfFramesOrParticlesIsAProgrammersError) {
  const FeatureConfig config;
  const Environment environment{Scene{}};
  const std::vector<Vec3f> one(1, Vec3f::zero()), two(2, Vec3f::zero());
  EXPECT_THROW(particle_features(config, {}, environment, std::vector(5, one)), std::logic_error);
  std::vector<std::vector<Vec3f>> uneven(6, one);
  uneven[2] = two;
  EXPECT_THROW(particle_features(config, {}, environment, uneven), std::logic_error);
}

TEST(Features, TrainingRefusesScenesWhoseChangesItDoesNotSee) {
  const auto refused = [](auto&& change, const std::string& what) {
    Scene scene = scene_with_ball({0.5, 0.5, 0.5}, 0.2);
    change(scene);
    try {
      check_training_scene(scene);
    } catch (const ConfigError& error) {
      return std::string(error.what()).find(what) != std::string::npos;
    }
    return false;
  };
  const auto move = [](Scene& s) { s.obstacles[0].motion = Motion{}; };
  const auto pour = [](Scene& s) { s.emitters.emplace_back(); };
  const auto drain = [](Scene& s) { s.sinks.emplace_back(); };
  const auto flatten = [](Scene& s) { s.domain.dimensions = 2; };
  EXPECT_TRUE(refused([](Scene& s) { s.kinematic_regions.emplace_back(); }, "particles that follow a script"));
  EXPECT_TRUE(refused(
      [](Scene& s) {
        s.domain.faces.x_low = s.domain.faces.x_high = WallConfig{Wall::periodic, {}};
      },
      "periodic walls"));
  for (const std::function<void(Scene&)>& change : std::vector<std::function<void(Scene&)>>{move, pour, drain}) {
    EXPECT_FALSE(refused(change, ""));
    EXPECT_TRUE(refused(
        [&](Scene& s) {
          change(s);
          flatten(s);
        },
        "in a plane"));
  }
  EXPECT_FALSE(refused(flatten, ""));
}

TEST(Features, EmbeddingRows) {
  EXPECT_EQ(embedding_row(0), 0);
  EXPECT_EQ(embedding_row(8), 8);
  EXPECT_THROW(embedding_row(9), InputError);
  EXPECT_THROW(embedding_row(-1), InputError);
}

TEST(Features, ProjectionMovesOnlyWhatIsInsideAnObstacleOrBeyondAWall) {
  const Environment environment(scene_with_ball({0.5, 0.5, 0.5}, 0.2));
  std::vector<Vec3f> x = {{0.5f, 0.69f, 0.5f}, {0.5f, 0.8f, 0.5f}, {0.5f, -0.2f, 0.5f}};
  const std::vector<Vec3f> before = x;
  EXPECT_EQ(project_out(environment, before, x), 2);
  EXPECT_GE(environment.obstacles.sample(x[0].cast<double>()).phi, -1e-6);
  EXPECT_NEAR(x[0][1], 0.7, 0.005);
  EXPECT_EQ(x[1], before[1]);
  EXPECT_NEAR(x[2][1], environment.hold_low[1], 1e-6);
  EXPECT_EQ(project_out(environment, std::vector<Vec3f>(x), x), 0);
}

Scene scene_with_plate() {
  Scene scene;
  Obstacle plate;
  plate.shape = Shape::box;
  plate.size = {0.6, 0.004, 0.6};  // a quarter of a cell
  plate.position = {0.5, 0.5, 0.5};
  plate.rotation_axis = {1, 0, 0};
  plate.rotation_angle = 20;
  scene.obstacles.push_back(plate);
  return scene;
}

TEST(Features, ProjectionLetsNothingThroughAThinPlate) {
  const Scene scene = scene_with_plate();
  const Environment environment(scene);
  const Vec3d normal = scene.obstacles[0].rotation() * Vec3d{0, 1, 0};
  const Random random(11, RandomPurpose::test);
  std::vector<Vec3f> before, x;
  for (uint64_t i = 0; i < 4000; ++i) {
    const Vec3d along =
        scene.obstacles[0].rotation() * Vec3d{random.uniform(i, 0, -0.1, 0.1), 0, random.uniform(i, 1, -0.1, 0.1)};
    const double way = 8.0 / 60;  // a frame at 8 m/s
    before.push_back(
        (scene.obstacles[0].position + along + normal * (0.0025 + 0.95 * way * random.uniform(i, 2))).cast<float>());
    x.push_back(
        (before.back().cast<double>() - normal * way + 0.3 * way * Vec3d{random.uniform(i, 3), 0, 0}).cast<float>());
  }
  const std::vector<Vec3f> wanted = x;
  EXPECT_EQ(project_out(environment, before, x), 4000);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3d from_plate = x[i].cast<double>() - scene.obstacles[0].position;
    ASSERT_GT(dot(from_plate, normal), 0) << i;
    ASSERT_GE(environment.obstacles.sample(x[i].cast<double>()).phi, -1e-6) << i;
    ASSERT_NEAR(x[i][0], wanted[i][0], 1e-5) << i;  // it slides on: the plate holds back its own direction alone
  }
}

TEST(Features, ProjectionLeavesAWayPastAnObstacleAsItIs) {
  const Environment environment(scene_with_plate());
  const Random random(12, RandomPurpose::test);
  std::vector<Vec3f> before, x;
  for (uint64_t i = 0; i < 4000; ++i) {
    const float side = static_cast<float>(random.uniform(i, 0, 0.81, 0.9));  // beside the plate, which ends at 0.8
    before.push_back({side, static_cast<float>(random.uniform(i, 1, 0.1, 0.9)), 0.5f});
    x.push_back(
        {side, static_cast<float>(random.uniform(i, 2, 0.1, 0.9)), static_cast<float>(random.uniform(i, 3, 0.2, 0.8))});
  }
  const std::vector<Vec3f> wanted = x;
  EXPECT_EQ(project_out(environment, before, x), 0);
  EXPECT_TRUE(x == wanted);
}

}  // namespace
}  // namespace graupel::graph
