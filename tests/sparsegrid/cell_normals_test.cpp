#include "sparsegrid/cell_normals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "sparsegrid/analytic_shape.h"
#include "tests/sparsegrid/test_scenes.h"

namespace graupel::sparsegrid {
namespace {

/// Distance to the nearest of the points, by brute force over those sorted by x.
class NearestPoint {
 public:
  explicit NearestPoint(std::vector<Vec3d> points) : points_(std::move(points)) {
    std::sort(points_.begin(), points_.end(), [](const Vec3d& a, const Vec3d& b) { return a[0] < b[0]; });
  }
  double distance(const Vec3d& x, double limit, bool skip_itself = false) const {
    double best = limit;
    auto p = std::lower_bound(points_.begin(), points_.end(), x[0] - limit,
                              [](const Vec3d& a, double value) { return a[0] < value; });
    for (; p != points_.end() && (*p)[0] <= x[0] + best; ++p)
      if (!(skip_itself && *p == x)) best = std::min(best, norm(*p - x));
    return best;
  }

 private:
  std::vector<Vec3d> points_;
};

Scene mixed_scene(double dx) {
  return scene_with({make_obstacle(Shape::cone, {0.3, 0.3, 0.3}, {1, 0, 1}, 50),
                     make_obstacle(Shape::box, {0.6, 0.35, 0.4}, {0, 1, 1}, 70),
                     make_obstacle(Shape::sphere, {0.7, 0.45, 0.5}), make_obstacle(Shape::plane, {0, 0.22, 0})},
                    dx);
}

TEST(SurfaceSamples, NoTwoAreCloseAndNoHoleIsLarge) {
  const Scene scene = mixed_scene(1.0 / 32);
  const ObstacleSet set(scene);
  for (const double spacing : {scene.domain.dx / 4, scene.domain.dx}) {
    const SurfaceSamples samples = sample_surface(scene, set, spacing);
    const NearestPoint nearest(samples.position);
    double closest = 1, largest_hole = 0;
    for (std::size_t i = 0; i < samples.position.size(); ++i) {
      closest = std::min(closest, nearest.distance(samples.position[i], 2 * spacing, true));
      const auto here = set.sample(samples.position[i]);
      ASSERT_NEAR(here.phi, 0, 1e-4 * scene.voxel());
      ASSERT_NEAR(norm(samples.normal[i]), 1, 1e-9);
    }
    EXPECT_GE(closest, spacing * (1 - 1e-12));
    // Probe: random points of the domain near the surface, moved onto it.
    const Random random(8, RandomPurpose::test);
    int probes = 0;
    for (uint64_t i = 0; i < 60000; ++i) {
      Vec3d x = random_point(random, i, 0.02, 0.98);
      if (std::abs(set.sample(x).phi) > 0.02) continue;
      for (int step = 0; step < 8; ++step) {
        const auto at = set.sample(x);
        x -= at.normal * at.phi;
      }
      bool inside_domain = std::abs(set.sample(x).phi) < 1e-6;
      for (int d = 0; d < 3; ++d) inside_domain = inside_domain && x[d] > 0 && x[d] < 1;
      if (!inside_domain) continue;
      ++probes;
      largest_hole = std::max(largest_hole, nearest.distance(x, 4 * spacing));
    }
    EXPECT_GT(probes, 3000);
    EXPECT_LE(largest_hole, 2 * spacing);
  }
}

TEST(SurfaceSamples, LeaveOutWhatIsCoveredOrOutside) {
  const Scene scene = mixed_scene(1.0 / 32);
  const ObstacleSet set(scene);
  const auto samples = sample_surface(scene, set, 0.01);
  for (const Vec3d& x : samples.position) {
    for (int i = 0; i < set.count(); ++i)
      ASSERT_GE(signed_distance(set.view().obstacles[i], x).phi, -1e-4 * scene.voxel());
    for (int d = 0; d < 3; ++d) ASSERT_TRUE(x[d] >= 0 && x[d] <= 1);
  }
  // The lower half of the cone's sphere of influence lies below the plane: fewer samples than alone.
  Scene alone = scene;
  alone.obstacles.pop_back();
  const auto without_plane = sample_surface(alone, ObstacleSet(alone), 0.01);
  const auto below = std::count_if(without_plane.position.begin(), without_plane.position.end(),
                                   [](const Vec3d& x) { return x[1] < 0.21; });
  EXPECT_GT(below, 100);
}

TEST(SurfaceSamples, DependOnSceneAndSeedAlone) {
  const Scene scene = mixed_scene(1.0 / 32);
  const int threads = num_threads();
  const auto a = sample_surface(scene, ObstacleSet(scene), 0.01);
  set_num_threads(1);
  const auto b = sample_surface(scene, ObstacleSet(scene), 0.01);
  set_num_threads(threads);
  EXPECT_EQ(a.position, b.position);
  EXPECT_EQ(a.normal, b.normal);
  EXPECT_NE(sample_surface(scene, ObstacleSet(scene), 0.01, 1).position, a.position);
}

TEST(CellNormals, OfALevelPlane) {
  Scene scene = scene_with({make_obstacle(Shape::plane, {0, 0.3 * 1.0 / 64 + 0.25, 0})});
  const CellNormals low(scene, ObstacleSet(scene));  // the surface lies below the centres of its cells
  EXPECT_EQ(low.active_cells(), 64 * 64);
  EXPECT_LT(norm(low.at({0.5, 0.25 + 1e-3, 0.5}) - Vec3f{0, 1, 0}), 1e-6f);
  EXPECT_EQ(norm(low.at({0.5, 0.25 - 1e-3, 0.5})), 0);
  EXPECT_EQ(norm(low.at({0.5, 0.25 + 1.01 / 64, 0.5})), 0);
  scene.obstacles[0].position[1] = 0.7 / 64 + 0.25;  // above the centres: the normal is flipped toward them
  const CellNormals high(scene, ObstacleSet(scene));
  EXPECT_LT(norm(high.at({0.5, 0.25 + 1e-3, 0.5}) - Vec3f{0, -1, 0}), 1e-6f);
  scene.obstacles[0].position[1] = 0.25;  // on the border of two cells: the outer one holds it
  const CellNormals border(scene, ObstacleSet(scene));
  EXPECT_EQ(border.active_cells(), 64 * 64);
  EXPECT_LT(norm(border.at({0.5, 0.25 + 1e-3, 0.5}) - Vec3f{0, 1, 0}), 1e-6f);
}

TEST(CellNormals, OfASphereFollowTheFlipRule) {
  Scene scene = scene_with({make_obstacle(Shape::sphere, {0.5, 0.5, 0.5})});
  scene.obstacles[0].radius = 0.25;
  const CellNormals normals(scene, ObstacleSet(scene));
  const double dx = scene.domain.dx;
  const Vec3d middle = scene.obstacles[0].position;
  int cells = 0, clear = 0;
  for (int k = 0; k < 64; ++k)
    for (int j = 0; j < 64; ++j)
      for (int i = 0; i < 64; ++i) {
        const Vec3d centre = Vec3d{i + 0.5, j + 0.5, k + 0.5} * dx;
        const Vec3f n = normals.at(centre);
        const double phi = norm(centre - middle) - 0.25;
        if (norm(n) == 0) {
          EXPECT_GT(std::abs(phi), 0.25 * dx);
          continue;
        }
        ++cells;
        EXPECT_NEAR(norm(n), 1, 1e-6);
        EXPECT_LT(std::abs(phi), 0.9 * dx);       // half a diagonal
        if (std::abs(phi) < 0.15 * dx) continue;  // the curved surface passes on both sides of the centre
        ++clear;
        const Vec3d outward = normalized(centre - middle) * (phi > 0 ? 1.0 : -1.0);
        EXPECT_GT(dot(n.cast<double>(), outward), 0.97);
      }
  EXPECT_EQ(cells, normals.active_cells());
  EXPECT_GT(clear, 3000);
  EXPECT_GT(normals.bytes(), sizeof(Vec3f) * static_cast<std::size_t>(cells));
}

TEST(CellNormals, WithoutObstaclesThereAreNone) {
  const CellNormals none{Scene(), ObstacleSet(Scene())};
  EXPECT_EQ(none.view().grid, nullptr);
  EXPECT_EQ(none.active_cells(), 0);
  EXPECT_EQ(norm(none.at({0.5, 0.5, 0.5})), 0);
}

TEST(CellNormals, FiveObstaclesTakeNoTime) {
  Scene scene;
  for (int i = 0; i < 5; ++i)
    scene.obstacles.push_back(
        make_obstacle(solid_shapes[i], {0.3 + 0.1 * i, 0.4 + 0.05 * i, 0.6 - 0.08 * i}, {1, 1.0 * i, 0}, 30.0 * i));
  const auto start = std::chrono::steady_clock::now();
  const ObstacleSet set(scene);
  const auto middle = std::chrono::steady_clock::now();
  const CellNormals normals(scene, set);
  const auto end = std::chrono::steady_clock::now();
  RecordProperty("obstacles_ms", std::to_string(std::chrono::duration<double, std::milli>(middle - start).count()));
  RecordProperty("normals_ms", std::to_string(std::chrono::duration<double, std::milli>(end - middle).count()));
  EXPECT_GT(normals.active_cells(), 1000);
  EXPECT_LT(std::chrono::duration<double>(end - start).count(), 3);  // some 0.3 s on an idle core
}

}  // namespace
}  // namespace graupel::sparsegrid
