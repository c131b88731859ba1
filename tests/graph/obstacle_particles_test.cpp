#include "graph/features/obstacle_particles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "core/math/random.h"
#include "random_input.h"

namespace graupel::graph {
namespace {

TEST(ObstacleParticles, LieOnTheSurfaceAndKeepTheirDistance) {
  const Scene scene = scene_with_ball({0.5, 0.4, 0.5}, 0.2);
  const ObstacleParticles particles(scene, sparsegrid::ObstacleSet(scene));
  for (const double spacing : {0.03, 0.05}) {
    const std::vector<Vec3f>& points = particles.at_spacing(spacing);
    // Between the densest packing of disks of that distance and holes of twice the spacing everywhere.
    const double area = 4 * M_PI * 0.04, densest = area / (std::sqrt(3.0) / 2 * spacing * spacing);
    EXPECT_LT(static_cast<double>(points.size()), densest);
    EXPECT_GT(static_cast<double>(points.size()), densest / 4);
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(norm(points[i].cast<double>() - Vec3d{0.5, 0.4, 0.5}), 0.2, 2e-3);
      for (std::size_t j = 0; j < i; ++j) ASSERT_GE(norm(points[i] - points[j]), 0.9999f * static_cast<float>(spacing));
    }
    EXPECT_EQ(&particles.at_spacing(spacing), &points);  // made once
  }
  const Scene empty;
  EXPECT_TRUE(ObstacleParticles(empty, sparsegrid::ObstacleSet(empty)).at_spacing(0.01).empty());
}

TEST(ObstacleParticles, SeveralThreadsGetTheSame) {
  const Scene scene = scene_with_ball({0.5, 0.4, 0.5}, 0.2);
  const ObstacleParticles particles(scene, sparsegrid::ObstacleSet(scene)), copy = particles;
  const std::vector<Vec3f>*a = nullptr, *b = nullptr;
  std::thread one([&] { a = &particles.at_spacing(0.04); });
  b = &copy.at_spacing(0.04);
  one.join();
  EXPECT_EQ(a, b);
}

TEST(WithinReach, AgreesWithAllPairs) {
  const std::vector<Vec3f> points = blobs(40, 2000, 0.2, 3);
  for (const double cutoff : {0.01, 0.1, 0.35, 5.0})
    for (const std::vector<Vec3f>& particles : {blobs(1, 1, 0), blobs(2, 200, 0.05), blobs(9, 900, 0.02, 7)}) {
      std::vector<int32_t> expected;
      for (std::size_t i = 0; i < points.size(); ++i)
        for (const Vec3f& p : particles)
          if (norm2(points[i].cast<double>() - p.cast<double>()) <= cutoff * cutoff) {
            expected.push_back(static_cast<int32_t>(i));
            break;
          }
      EXPECT_EQ(within_cutoff(points, particles, cutoff), expected) << cutoff;
    }
  EXPECT_TRUE(within_cutoff(points, {}, 1).empty());
  EXPECT_TRUE(within_cutoff({}, points, 1).empty());
}

}  // namespace
}  // namespace graupel::graph
