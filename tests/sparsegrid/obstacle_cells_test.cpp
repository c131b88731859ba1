// Look-ups by lists give the bits of look-ups that ask every obstacle, and ask few.
#include "sparsegrid/obstacle_cells.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "sparsegrid/obstacle_set.h"
#include "sparsegrid/push_out.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

const std::string vdb_file = testing::TempDir() + "graupel_cells_" + std::to_string(::getpid()) + ".vdb";

/// Obstacles of all kinds in and around the domain; some lie twice in the same place.
Scene crowded_scene(std::size_t count, uint64_t seed) {
  const Random random(seed, RandomPurpose::test);
  std::vector<Obstacle> obstacles;
  while (obstacles.size() < count) {
    const uint64_t i = obstacles.size();
    if (i % 17 == 16) {
      obstacles.push_back(obstacles[i - 9]);
      continue;
    }
    const Shape shape = i % 11 == 9 ? Shape::vdb : i % 11 == 10 ? Shape::mesh : solid_shapes[i % 7];
    Obstacle one = make_obstacle(shape, random_point(random, 2 * i, -0.1, 1.1), random_point(random, 2 * i + 1, -1, 1),
                                 random.uniform(2 * i, 3, 0, 180));
    one.size = Vec3d{0.09, 0.05, 0.07};
    one.radius = random.uniform(2 * i + 1, 3, 0.03, 0.1);
    one.height = 0.08;
    one.file = shape == Shape::vdb ? vdb_file : "cube";
    if (shape == Shape::mesh) one.mesh = std::make_shared<TriangleMesh>(cube_mesh(0.07));
    if (i % 40 == 3) one = make_obstacle(Shape::plane, {0.5, 0.04, 0.5});
    if (i % 40 == 23) one = make_obstacle(Shape::plane, {0.5, 0.03, 0.5}, {1, 0, 0.3}, 7);
    obstacles.push_back(one);
  }
  return scene_with(obstacles);
}

class ObstacleCells : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Scene ball = scene_with({make_obstacle(Shape::sphere, {0, 0, 0})});
    ball.obstacles[0].radius = 0.05;
    ObstacleSet(ball).write_vdb(vdb_file);
  }
  static void TearDownTestSuite() { std::filesystem::remove(vdb_file); }
};

/// The views with lists made for them.
struct Listed {
  std::vector<ObstacleView> views;
  ObstacleLists lists;
  Listed(std::vector<ObstacleView> of, const Scene& scene, const std::vector<bool>& moves)
      : views(std::move(of)),
        lists(list_obstacles(views, moves, scene.domain.origin, scene.domain.origin + scene.domain.size)) {}
  ObstacleSetView view() const {
    ObstacleSetView set = {views.data(), static_cast<int>(views.size()), lists.cells};
    if (lists.begin.empty()) return set;
    set.cells.begin = lists.begin.data();
    set.cells.place = lists.place.data();
    return set;
  }
};

template <typename V>
bool same_bits(const V& a, const V& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// Points in and around the domain, on its faces, far off, and those that are none.
template <typename T>
Vec<T, 3> any_point(const Random& random, uint64_t i) {
  const double reach = i % 4 == 0 ? 2.5 : 0.1;
  Vec<T, 3> x = random_point(random, i, -reach, 1 + reach).cast<T>();
  const auto axis = static_cast<int>(i / 8 % 3);
  if (i % 8 == 7) x[axis] = T(i / 24 % 2);
  if (i % 64 == 5) x[axis] = std::numeric_limits<T>::quiet_NaN();
  if (i % 64 == 6) x[axis] = (i / 64 % 2 == 0 ? T(1) : T(-1)) * std::numeric_limits<T>::infinity();
  return x;
}

struct Found {
  int near = 0, pushed = 0, met = 0, unmet = 0;
};

/// Of the box around two points, which may meet an obstacle wherever one of its points may be inside of one.
template <typename T>
void expect_same_meeting(const ObstacleSetView& all, const ObstacleSetView& listed, const Vec<T, 3>& a,
                         const Vec<T, 3>& b, Found& found) {
  if (std::isnan(norm(a))) return;
  Vec<T, 3> low, high;
  for (int d = 0; d < 3; ++d) {
    low[d] = std::min(a[d], b[d]);
    high[d] = std::max(a[d], b[d]);
  }
  const bool meets = lookup::may_meet_solid(all, low, high);
  EXPECT_EQ(meets, lookup::may_meet_solid(listed, low, high));
  for (int k = 0; k <= 4; ++k)
    EXPECT_TRUE(meets || lookup::deepest(all, a + (b - a) * (T(k) / T(4))).phi == static_cast<T>(no_obstacle_distance));
  ++(meets ? found.met : found.unmet);
}

template <typename T>
Found expect_same(const ObstacleSetView& listed, uint64_t points, uint64_t seed) {
  ObstacleSetView all = listed;
  all.cells = {};
  const Random random(seed, RandomPurpose::test);
  Found found;
  for (uint64_t i = 0; i < points; ++i) {
    const Vec<T, 3> x = any_point<T>(random, i);
    int a = -2, b = -2;
    const SignedDistance<T> expected = signed_distance(all, x, a), got = signed_distance(listed, x, b);
    EXPECT_TRUE(same_bits(expected, got) && a == b) << x[0] << " " << x[1] << " " << x[2];
    EXPECT_TRUE(same_bits(lookup::deepest(all, x), lookup::deepest(listed, x)));
    const Vec<T, 3> before = x + random_point(random, points + i, -0.04, 0.04).cast<T>();
    Vec<T, 3> y = x, z = x;
    const bool moved = push_out(all, Vec<T, 3>::filled(0), Vec<T, 3>::filled(1), before, y);
    EXPECT_EQ(moved, push_out(listed, Vec<T, 3>::filled(0), Vec<T, 3>::filled(1), before, z));
    EXPECT_TRUE(same_bits(y, z));
    expect_same_meeting(all, listed, x, before, found);
    found.near += a >= 0;
    found.pushed += moved;
    if (testing::Test::HasFailure()) return found;
  }
  return found;
}

TEST_F(ObstacleCells, ListsGiveTheBitsOfAskingAll) {
  const Scene scene = crowded_scene(200, 1);
  const ObstacleSet set(scene);
  const std::vector<ObstacleView> views = set.views_at(0);
  Found found;
  int listed = 0;
  for (std::size_t n = 1; n <= views.size(); n += n < 30 ? 1 : 17) {
    const Listed part({views.begin(), views.begin() + static_cast<std::ptrdiff_t>(n)}, scene, std::vector<bool>(n));
    listed += part.view().cells.begin != nullptr;
    for (const Found& one : {expect_same<double>(part.view(), 2000, n), expect_same<float>(part.view(), 2000, n)}) {
      found.near += one.near;
      found.pushed += one.pushed;
      found.met += one.met;
      found.unmet += one.unmet;
    }
    ASSERT_FALSE(HasFailure()) << n << " obstacles";
  }
  EXPECT_GT(listed, 25);
  EXPECT_GT(found.near, 10000);
  EXPECT_GT(found.pushed, 10000);
  EXPECT_GT(found.met, 10000);
  EXPECT_GT(found.unmet, 10000);
}

TEST_F(ObstacleCells, HoldWhereverObstaclesMove) {
  Scene scene = crowded_scene(60, 2);
  for (std::size_t i = 0; i < scene.obstacles.size(); i += 5) {
    Motion& motion = scene.obstacles[i].motion.emplace();
    motion.velocity = Vec3d{0.4, -0.3, 0.1};
    motion.spin = 2;
  }
  const ObstacleSet set(scene);
  ASSERT_NE(set.view().cells.begin, nullptr);
  for (const double time : {0.0, 0.7, 3.0}) {
    const std::vector<ObstacleView> views = set.views_at(time);
    const Found found = expect_same<float>({views.data(), set.count(), set.cells()}, 20000, 3);
    EXPECT_GT(found.near, 1000) << time;
  }
}

/// The obstacle moved by `way` [m].
ObstacleView moved_by(ObstacleView obstacle, const Vec3d& way) {
  ObstacleFrame<double> frame = obstacle.exact;
  for (Vec3d* x : {&frame.position, &frame.low, &frame.high, &frame.solid_low, &frame.solid_high}) *x += way;
  obstacle.set_frame(frame);
  return obstacle;
}

TEST_F(ObstacleCells, AskFewOfMany) {
  Scene scene = scene_with({}, 1.0 / 32);
  scene.domain.size = {24, 1, 24};
  for (const Shape shape : solid_shapes) {
    scene.obstacles.push_back(make_obstacle(shape, {0, 0.2, 0}));
    scene.obstacles.back().radius = scene.obstacles.back().height = 0.1;
    scene.obstacles.back().size = Vec3d::filled(0.2);
  }
  const ObstacleSet set(scene);
  const Random random(4, RandomPurpose::test);
  std::vector<ObstacleView> views;
  for (uint64_t i = 0; i < 1700; ++i)
    views.push_back(
        moved_by(set.view().obstacles[i % 7], {random.uniform(i, 0, 0, 24), 0, random.uniform(i, 1, 0, 24)}));
  const Listed many(views, scene, std::vector<bool>(views.size()));
  int64_t asked = 0, near = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const Vec3d x = {random.uniform(i, 2, 0, 24), 0.2, random.uniform(i, 3, 0, 24)};
    int nearest;
    signed_distance(many.view(), x, nearest);
    asked += many.view().near(x).count;
    near += nearest >= 0;
  }
  EXPECT_GT(near, 3000);
  EXPECT_LT(asked, 4 * near);
  EXPECT_LT(many.lists.begin.size(), 64u * 1700);
}

TEST_F(ObstacleCells, NoListsWhereTheySpareNothing) {
  std::vector<Obstacle> planes;
  for (int i = 0; i < 40; ++i) planes.push_back(make_obstacle(Shape::plane, {0.5, 0.1, 0.5}, {1, 0, 0}, 2 + i));
  EXPECT_EQ(ObstacleSet(scene_with(planes)).cells().begin, nullptr);
  EXPECT_EQ(ObstacleSet(crowded_scene(fewest_listed_obstacles - 1, 5)).cells().begin, nullptr);
  EXPECT_NE(ObstacleSet(crowded_scene(fewest_listed_obstacles, 5)).cells().begin, nullptr);
}

TEST_F(ObstacleCells, AreBoundedWhereManyObstaclesAreEverywhere) {
  std::vector<Obstacle> obstacles;
  for (int i = 0; i < 4000; ++i) {
    obstacles.push_back(make_obstacle(Shape::plane, {0.5, 0.1, 0.5}));
    if (i % 8 == 0) obstacles.back() = make_obstacle(Shape::plane, {0.5, 0.1, 0.5}, {1, 0, 0}, 10);
  }
  const ObstacleSet set(scene_with(obstacles));
  ASSERT_NE(set.cells().begin, nullptr);
  EXPECT_LT(set.view().near(Vec3d{0.5, 0.9, 0.5}).count, 1000);
  const Vec3i size = set.cells().size;
  EXPECT_LT(set.cells().begin[size[0] * size[1] * size[2]], 2000000);
}

}  // namespace
}  // namespace graupel::sparsegrid
