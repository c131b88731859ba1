// After push_out no point is inside an obstacle or outside the box, whatever the precision, the shape and the corner.
#include "sparsegrid/push_out.h"

#include <gtest/gtest.h>

#include "sparsegrid/obstacle_set.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

struct Tally {
  int entered = 0;         ///< points that were inside an obstacle or outside the box
  double worst = 1;        ///< smallest phi afterwards [dx]
  double mean_travel = 0;  ///< mean way of the points that were moved by push_out alone [dx]
  double longest = 0;      ///< longest such way [dx]
};

/// Throws points a random way of at most `reach` [m] from free places, in precision T.
template <typename T>
Tally throw_points(const Scene& scene, const Vec3d& low, const Vec3d& high, double reach, uint64_t n, uint64_t seed) {
  const ObstacleSet set(scene);
  const Vec<T, 3> box_low = scene.wall_low().cast<T>(), box_high = scene.wall_high().cast<T>();
  const Random random(seed, RandomPurpose::test);
  Tally tally;
  for (uint64_t i = 0; i < n; ++i) {
    Vec<T, 3> before;
    for (int d = 0; d < 3; ++d) before[d] = static_cast<T>(random.uniform(2 * i, d, low[d], high[d]));
    before = lookup::clamp_to_box(before, box_low, box_high);
    if (set.sample(before.template cast<double>()).phi < 0) continue;
    const Vec<T, 3> wanted = before + random_point(random, 2 * i + 1, -reach, reach).cast<T>();
    Vec<T, 3> x = wanted;
    const bool moved = push_out(set.view(), box_low, box_high, before, x);
    EXPECT_EQ(moved, !(x == wanted));
    const double phi = set.sample(x.template cast<double>()).phi / scene.domain.dx;
    tally.worst = std::min(tally.worst, phi);
    for (int d = 0; d < 3; ++d) EXPECT_TRUE(x[d] >= box_low[d] && x[d] <= box_high[d]);
    if (!moved) continue;
    ++tally.entered;
    const double way = static_cast<double>(norm(x - wanted)) / scene.domain.dx;
    tally.mean_travel += way;
    tally.longest = std::max(tally.longest, way);
  }
  tally.mean_travel /= std::max(tally.entered, 1);
  return tally;
}

template <typename T>
void expect_all_out(const Scene& scene, const Vec3d& low, const Vec3d& high, double reach, const char* what) {
  const Tally tally = throw_points<T>(scene, low, high, reach, 20000, 11);
  EXPECT_GE(tally.worst, -1e-6) << what;
  EXPECT_GT(tally.entered, 300) << what;
  EXPECT_LE(tally.longest, 2 * std::sqrt(3.0) * reach / scene.domain.dx) << what;
}

void expect_all_out(const Scene& scene, const Vec3d& low, const Vec3d& high, double reach, const char* what) {
  expect_all_out<float>(scene, low, high, reach, what);
  expect_all_out<double>(scene, low, high, reach, what);
}

constexpr double dx = 1.0 / 64;

TEST(PushOut, ConcaveCornerOfTwoBoxes) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.2, 0.5}), make_obstacle(Shape::box, {0.3, 0.35, 0.5})});
  scene.obstacles[0].size = {0.6, 0.2, 0.4};
  scene.obstacles[1].size = {0.2, 0.4, 0.4};
  expect_all_out(scene, {0.4, 0.3, 0.4}, {0.4 + dx, 0.3 + dx, 0.6}, dx, "right angle");
  scene.obstacles[1].rotation_axis = {0, 0, 1};
  scene.obstacles[1].rotation_angle = -40;  // leaning over the lower box: a sharp wedge
  expect_all_out(scene, {0.4, 0.3, 0.4}, {0.5, 0.4, 0.6}, 2 * dx, "wedge");
}

TEST(PushOut, BoxAgainstTheWall) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.1, 0.5}, {0, 0, 1}, 30)});
  expect_all_out(scene, {0.2, 0.04, 0.4}, {0.8, 0.3, 0.6}, dx, "leaning box");
  scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.15, 0.5})});
  expect_all_out(scene, {0.3, 0.04, 0.3}, {0.7, 0.2, 0.7}, dx, "sphere on the floor");
}

TEST(PushOut, ThinPlatesAndTips) {
  for (const double voxels : {1.2, 1.5, 2.0}) {
    Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5}, {1, 0, 2}, 35)});
    scene.obstacles[0].size = {0.3, voxels * scene.voxel(), 0.3};
    expect_all_out(scene, {0.35, 0.35, 0.35}, {0.65, 0.65, 0.65}, dx, "plate");
  }
  Scene scene = scene_with({make_obstacle(Shape::cone, {0.5, 0.5, 0.5}, {1, 0, 0}, 15)});
  scene.obstacles[0].radius = 0.04;
  expect_all_out(scene, {0.45, 0.4, 0.45}, {0.55, 0.65, 0.55}, dx, "cone");
}

TEST(PushOut, AnySceneAnyReach) {
  const Scene scene = scene_with({make_obstacle(Shape::cone, {0.3, 0.3, 0.3}, {1, 0, 1}, 50),
                                  make_obstacle(Shape::pyramid, {0.6, 0.35, 0.4}, {0, 1, 1}, 70),
                                  make_obstacle(Shape::half_sphere, {0.4, 0.6, 0.6}, {1, 2, 0}, 110),
                                  make_obstacle(Shape::half_box, {0.65, 0.6, 0.7}, {3, 1, 1}, 20),
                                  make_obstacle(Shape::plane, {0.5, 0.12, 0.5}, {0, 0, 1}, 5)});
  for (const double reach : {0.2 * dx, dx, 10 * dx}) expect_all_out(scene, {0, 0, 0}, {1, 1, 1}, reach, "mixed");
}

TEST(PushOut, GoesToTheNearestSurfacePoint) {
  const Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  const ObstacleSet set(scene);
  const Vec3d low = scene.wall_low(), high = scene.wall_high(), direction = normalized(Vec3d{1, 2, -1});
  Vec3d x = scene.obstacles[0].position + direction * 0.13;
  ASSERT_TRUE(push_out(set.view(), low, high, scene.obstacles[0].position + direction * 0.15, x));
  EXPECT_LT(norm(x - (scene.obstacles[0].position + direction * 0.14)), 2e-4);
  const Vec3d outside = {0.2, 0.2, 0.2};
  x = outside;
  EXPECT_FALSE(push_out(set.view(), low, high, outside, x));
  EXPECT_EQ(x, outside);
  x = {0.2, -3, 0.2};
  EXPECT_TRUE(push_out(set.view(), low, high, outside, x));
  EXPECT_EQ(x, (Vec3d{0.2, low[1], 0.2}));
  x = outside;
  EXPECT_FALSE(push_out(ObstacleSetView{nullptr, 0}, low, high, outside, x));
}

TEST(PushOut, LeavesAPlateOnTheSideItCameFrom) {
  Scene scene = scene_with({make_obstacle(Shape::box, {0.5, 0.5, 0.5})});
  scene.obstacles[0].size = {0.4, 2 * scene.voxel(), 0.4};
  const ObstacleSet set(scene);
  const Random random(6, RandomPurpose::test);
  for (uint64_t i = 0; i < 2000; ++i) {
    const Vec3f before = {0.5f, 0.5f + static_cast<float>(scene.voxel() * random.uniform(i, 0, 1.01, 1.5)), 0.5f};
    Vec3f x = {static_cast<float>(random.uniform(i, 1, 0.49, 0.51)),
               0.5f + static_cast<float>(scene.voxel() * random.uniform(i, 2, -0.99, 0.99)), 0.5f};
    ASSERT_TRUE(push_out(set.view(), Vec3f::filled(0), Vec3f::filled(1), before, x));
    ASSERT_GT(x[1], 0.5f);
  }
}

TEST(PushOut, IsDoneOnce) {
  const Scene scene = scene_with({make_obstacle(Shape::pyramid, {0.5, 0.5, 0.5}, {1, 1, 0}, 33),
                                  make_obstacle(Shape::plane, {0.5, 0.4, 0.5}, {1, 0, 0}, 11)});
  const ObstacleSet set(scene);
  const Random random(7, RandomPurpose::test);
  const Vec3f low = scene.wall_low().cast<float>(), high = scene.wall_high().cast<float>();
  int again = 0, moved = 0;
  for (uint64_t i = 0; i < 50000; ++i) {
    const Vec3f before = random_point(random, 2 * i, 0.1, 0.9).cast<float>();
    if (set.sample(before.cast<double>()).phi < 0) continue;
    Vec3f x = before + random_point(random, 2 * i + 1, -0.02, 0.02).cast<float>();
    if (!push_out(set.view(), low, high, before, x)) continue;
    ++moved;
    Vec3f y = x;
    again += push_out(set.view(), low, high, before, y);
  }
  EXPECT_GT(moved, 200);
  EXPECT_EQ(again, 0);
}

}  // namespace
}  // namespace graupel::sparsegrid
