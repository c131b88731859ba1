#include "sparsegrid/obstacle_set.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "sparsegrid/analytic_shape.h"
#include "tests/io/expect_error.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

/// Largest error of phi, and of the direction where the surface is smooth, over points near the obstacle.
struct Errors {
  double phi = 0, smooth_phi = 0, smooth_normal = 0;
  int smooth = 0, outside_band = 0;
};

Errors errors_of(const Scene& scene, const ObstacleSet& set) {
  const Obstacle& obstacle = scene.obstacles[0];
  const double voxel = scene.voxel(), band = scene.band();
  const Random random(3, RandomPurpose::test);
  Errors e;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = random_point(random, i, 0.1, 0.9);
    const auto exact = [&](const Vec3d& y) { return analytic_distance(obstacle, obstacle.to_local(y)); };
    const double expected = std::clamp(exact(x), -band, band);
    const auto got = set.sample(x);
    e.phi = std::max(e.phi, std::abs(got.phi - expected));
    if (std::abs(exact(x)) > band + 2 * voxel) {
      EXPECT_EQ(norm(got.normal), 0);
      EXPECT_NEAR(std::abs(got.phi), band, 1e-7);
      ++e.outside_band;
    }
    if (std::abs(expected) > band - 2 * voxel) continue;
    // Smooth: the gradient is the same all around, so neither an edge nor the medial axis is near.
    Vec3d g[2];
    for (int side = 0; side < 2; ++side)
      for (int d = 0; d < 3; ++d) {
        Vec3d step = Vec3d::zero();
        step[d] = 2.5 * voxel;
        g[side][d] = (side == 0 ? exact(x + step) - exact(x) : exact(x) - exact(x - step)) / step[d];
      }
    if (norm(g[0] - g[1]) > 0.3 || std::abs(norm(g[0] + g[1]) - 2) > 0.01) continue;
    ++e.smooth;
    e.smooth_phi = std::max(e.smooth_phi, std::abs(got.phi - expected));
    e.smooth_normal = std::max(e.smooth_normal, norm(got.normal - normalized(g[0] + g[1])));
  }
  return e;
}

TEST(ObstacleSet, EqualBodiesShareAGridAndHaveNamesOfTheirOwn) {
  const Obstacle ball = make_obstacle(Shape::sphere, {0.3, 0.5, 0.5}, {0, 1, 0}, 0);
  Obstacle other = make_obstacle(Shape::sphere, {0.7, 0.5, 0.5}, {1, 0, 0}, 20);
  Obstacle larger = other;
  larger.radius *= 1.5;
  const ObstacleSet set(scene_with({ball, other, larger}));
  const std::vector<ObstacleView> views = set.views_at(0);
  EXPECT_EQ(views[0].grid, views[1].grid);
  EXPECT_NE(views[0].grid, views[2].grid);
  EXPECT_EQ(set.facts(0).name, "obstacle_0_sphere");
  EXPECT_EQ(set.facts(1).name, "obstacle_1_sphere");
}

TEST(ObstacleSet, TheFirstBadObstacleIsToldBeforeTheOthersAreBuilt) {
  std::vector<Obstacle> many;
  for (int i = 0; i < 150; ++i) {
    many.push_back(make_obstacle(Shape::sphere, {0.5, 0.5, 0.5}, {0, 1, 0}, 0));
    many.back().radius = 0.05 + 1e-4 * i;
  }
  const Stopwatch all;
  static_cast<void>(ObstacleSet(scene_with(many)));
  const double seconds_of_all = all.seconds();
  many[0].radius = many[90].radius = 1e-4;
  for (Obstacle& body : many) body.radius += 1e-6;  // none is known from before
  const Stopwatch refusal;
  expect_error<ConfigError>([&] { static_cast<void>(ObstacleSet(scene_with(many))); },
                            {"obstacle_0_sphere is smaller than two voxels"});
  EXPECT_LT(refusal.seconds(), 0.5 * seconds_of_all);
}

TEST(ObstacleSet, GridEqualsTheFormulaUnderAnyPose) {
  for (const Shape shape : solid_shapes) {
    const Scene scene = scene_with({make_obstacle(shape, {0.52, 0.47, 0.5}, {1, 2, -0.5}, 37)});
    const ObstacleSet set(scene);
    const Errors e = errors_of(scene, set);
    const double voxel = scene.voxel();
    EXPECT_LT(e.phi, 0.9 * voxel) << word_of(shape);  // a corner cut by the interpolation
    EXPECT_LT(e.smooth_phi, 1.5 * voxel * voxel / 0.14) << word_of(shape);
    EXPECT_LT(e.smooth_normal, 0.15) << word_of(shape);
    EXPECT_GT(e.smooth, 500) << word_of(shape);
    EXPECT_GT(e.outside_band, 1000) << word_of(shape);
  }
}

TEST(ObstacleSet, ErrorFallsWithTheSquareOfTheVoxel) {
  Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  scene.obstacle_band = 0.08;
  const auto largest_error = [&](double voxel) {
    scene.obstacle_voxel = voxel;
    const ObstacleSet set(scene);
    const Random random(13, RandomPurpose::test);
    double largest = 0;
    for (uint64_t i = 0; i < 20000; ++i) {
      const Vec3d x = random_point(random, i, 0.3, 0.7);
      const double phi = norm(x - scene.obstacles[0].position) - scene.obstacles[0].radius;
      if (std::abs(phi) < 0.04) largest = std::max(largest, std::abs(set.sample(x).phi - phi));
    }
    return largest;
  };
  const double ratio = largest_error(0.02) / largest_error(0.01);
  EXPECT_GT(ratio, 3.2);
  EXPECT_LT(ratio, 5);
}

TEST(ObstacleSet, DeepInsideIsInside) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  scene.obstacles[0].size = {0.9, 0.8, 0.7};
  scene.obstacle_band = 0.05;
  const ObstacleSet set(scene);
  int nearest = -2;
  for (double y = 0.16; y < 0.84; y += 0.01) {
    const auto at = set.sample({0.5, y, 0.5}, &nearest);
    ASSERT_NEAR(at.phi, std::max(-0.05, std::abs(y - 0.5) - 0.4), 1e-6);
    ASSERT_EQ(nearest, 0);
  }
}

/// Blocks of the grid that lie beyond the band, but not so far that they were never sampled.
TEST(ObstacleSet, ABallHasNoHolesBehindItsBand) {
  Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  scene.obstacles[0].radius = 0.25;
  scene.obstacle_voxel = 0.005;
  scene.obstacle_band = 0.1;
  const ObstacleSet set(scene);
  const Random random(17, RandomPurpose::test);
  int beyond = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = random_point(random, i, 0.3, 0.7);
    const double depth = 0.25 - norm(x - scene.obstacles[0].position);
    ASSERT_NEAR(set.sample(x).phi, -std::min(depth, 0.1), 0.006) << depth;
    beyond += depth > 0.1;
  }
  EXPECT_GT(beyond, 3000);
}

TEST(ObstacleSet, PlaneHasNoBorder) {
  const Scene scene = scene_with({make_obstacle(Shape::plane, {0.5, 0.2, 0.5}, {0, 0, 1}, 30)});
  const ObstacleSet set(scene);
  const Obstacle& plane = scene.obstacles[0];
  const Vec3d up = {-0.5, std::sqrt(3.0) / 2, 0};
  for (const double along : {-50.0, -0.3, 0.0, 7.0})
    for (const double height : {-0.09, -0.02, 0.03, 0.09}) {
      const auto at = set.sample(plane.to_world({along, height, 2 * along}));
      EXPECT_NEAR(at.phi, height, 1e-12);
      EXPECT_LT(norm(at.normal - up), 1e-12);
    }
  EXPECT_EQ(set.sample(plane.to_world({3, 0.2, 0})).phi, static_cast<double>(static_cast<float>(scene.band())));
  EXPECT_EQ(set.sample(plane.to_world({3, -5, 0})).phi, -static_cast<double>(static_cast<float>(scene.band())));
  EXPECT_EQ(norm(set.sample(plane.to_world({3, -5, 0})).normal), 0);
}

TEST(ObstacleSet, UnionTakesTheNearest) {
  const Scene scene =
      scene_with({make_obstacle(Shape::sphere, {0.3, 0.5, 0.5}), make_obstacle(Shape::sphere, {0.7, 0.5, 0.5}),
                  make_obstacle(Shape::plane, {0, 0.1, 0})});
  const ObstacleSet set(scene);
  EXPECT_EQ(set.count(), 3);
  int nearest = -2;
  EXPECT_NEAR(set.sample({0.46, 0.5, 0.5}, &nearest).phi, 0.02, 1e-3);
  EXPECT_EQ(nearest, 0);
  EXPECT_NEAR(set.sample({0.6, 0.5, 0.5}, &nearest).phi, -0.04, 1e-3);
  EXPECT_EQ(nearest, 1);
  EXPECT_NEAR(set.sample({0.5, 0.13, 0.5}, &nearest).phi, 0.03, 1e-9);
  EXPECT_EQ(nearest, 2);
  EXPECT_NEAR(set.sample({0.5, 0.9, 0.5}, &nearest).phi, scene.band(), 1e-7);
  EXPECT_EQ(nearest, -1);
  EXPECT_EQ(ObstacleSet().count(), 0);
  EXPECT_EQ(ObstacleSet(Scene()).sample({0, 0, 0}, &nearest).phi, no_obstacle_distance);
  EXPECT_EQ(nearest, -1);
}

TEST(ObstacleSet, FloatAgreesWithDouble) {
  const Scene scene = scene_with({make_obstacle(Shape::cone, {0.5, 0.5, 0.5}, {1, 1, 0}, 60)});
  const ObstacleSet set(scene);
  const Random random(4, RandomPurpose::test);
  for (uint64_t i = 0; i < 5000; ++i) {
    const Vec3f x = random_point(random, i, 0.2, 0.8).cast<float>();
    const auto narrow = signed_distance(set.view().obstacles[0], x);
    const auto wide = signed_distance(set.view().obstacles[0], x.cast<double>());
    ASSERT_NEAR(narrow.phi, wide.phi, 1e-6);
  }
}

TEST(ObstacleSet, FactsOfABox) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5}), make_obstacle(Shape::plane, {0, 0.1, 0})});
  scene.obstacles[0].size = {0.2, 0.2, 0.2};
  scene.obstacle_voxel = 0.01;
  scene.obstacle_band = 0.035;
  const ObstacleSet set(scene);
  const GridFacts box = set.facts(0);
  EXPECT_EQ(box.name, "obstacle_0_box");
  EXPECT_EQ(box.grid_class, "level set");
  EXPECT_DOUBLE_EQ(box.voxel, 0.01);
  EXPECT_FLOAT_EQ(static_cast<float>(box.background), 0.035f);
  EXPECT_EQ(box.index_low, (Vec3i{-13, -13, -13}));
  EXPECT_EQ(box.index_high, (Vec3i{13, 13, 13}));
  EXPECT_NEAR(box.world_high[1], 0.13, 1e-9);
  EXPECT_NEAR(box.min_value, -0.03, 1e-7);
  EXPECT_LT(box.max_value, 0.035);
  EXPECT_GT(box.bytes, 4 * box.active_voxels);
  // Cubes of 27 voxels with rounded edges, hollow inside: between the flat and the full count.
  EXPECT_GT(box.active_voxels, 19 * 19 * 19 + 6 * 21 * 21 * 3 - 13 * 13 * 13);
  EXPECT_LT(box.active_voxels, 27 * 27 * 27 - 13 * 13 * 13);
  EXPECT_GT(set.facts(1).active_voxels, 100 * 100 * 6);
}

/// Grids do not depend on the pose, and sets of one scene share them; other sizes, voxels and bands have their own.
TEST(ObstacleSet, SetsShareTheGridsOfTheSameBodies) {
  const Scene scene = scene_with({make_obstacle(Shape::cone, {0.5, 0.5, 0.5})});
  Scene moved = scene, larger = scene, finer = scene, wider = scene;
  moved.obstacles[0].position = {0.4, 0.6, 0.5};
  larger.obstacles[0].radius *= 1.25;
  finer.obstacle_voxel = scene.voxel() / 2;
  wider.obstacle_band = scene.band() * 1.5;
  const ObstacleSet set(scene);
  const auto grid_of = [](const ObstacleSet& one) { return one.view().obstacles[0].grid; };
  const auto* grid = grid_of(set);
  EXPECT_EQ(grid_of(ObstacleSet(scene)), grid);
  EXPECT_EQ(grid_of(ObstacleSet(moved)), grid);
  EXPECT_NE(grid_of(ObstacleSet(larger)), grid);
  EXPECT_NE(grid_of(ObstacleSet(finer)), grid);
  EXPECT_NE(grid_of(ObstacleSet(wider)), grid);
  EXPECT_LT(ObstacleSet(moved).sample({0.4, 0.6, 0.5}).phi, 0);
  EXPECT_GT(ObstacleSet(moved).sample({0.7, 0.5, 0.5}).phi, 0);
}

TEST(ObstacleSet, RefusesWhatCannotBeAnObstacle) {
  EXPECT_THROW(ObstacleSet(scene_with({make_obstacle(Shape::points, {0.5, 0.5, 0.5})})), ConfigError);
  Scene narrow = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  narrow.obstacle_band = 1.5 * narrow.voxel();
  EXPECT_THROW(ObstacleSet{narrow}, ConfigError);
  Scene thin = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  thin.obstacles[0].position = {0.5, 0.5, 0.5};
  thin.obstacles[0].shape = Shape::half_box;
  thin.obstacles[0].size = {0.3, 0.5 * thin.voxel(), 0.3};
  EXPECT_THROW(ObstacleSet{thin}, ConfigError);
  Scene fine = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  fine.obstacle_voxel = 1e-4;  // too many blocks
  EXPECT_THROW(ObstacleSet{fine}, ConfigError);
  fine.obstacle_voxel = 1e-6;  // smaller than OpenVDB can transform
  EXPECT_THROW(ObstacleSet{fine}, ConfigError);
}

}  // namespace
}  // namespace graupel::sparsegrid
