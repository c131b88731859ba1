// Points of clusters: all particles as points are exact, and points that are chosen are nearer to all particles than
// random ones.
#include <gtest/gtest.h>

#include "core/math/random.h"
#include "train/reduced/cubature_rows.h"

namespace graupel::train {
namespace {

constexpr double dx = 0.02;

double drawn(uint64_t i, int c, double low, double high) {
  return Random(21, RandomPurpose::test).uniform(i, c, low, high);
}

/// A body of unlike particles in clusters, and what it takes to describe it.
struct Body {
  Body(int count, int cluster) {
    std::vector<Vec3f> x;
    for (int p = 0; p < count; ++p) {
      const auto i = static_cast<uint64_t>(p);
      x.push_back({static_cast<float>(drawn(i, 0, 0.2, 0.3)), static_cast<float>(drawn(i, 1, 0.2, 0.3)),
                   static_cast<float>(drawn(i, 2, 0.2, 0.3))});
      volume.push_back(1e-6);
      mass.push_back(1e-3);
    }
    clusters = rom::make_clusters(x, std::vector<int32_t>(x.size(), 0), cluster);
    for (const Vec3f& at : x) reference.insert(reference.end(), at.a, at.a + 3);
  }
  QuadratureBody view() const { return {clusters, mass, volume, {0, 0, 0}, dx}; }
  /// All moved by `way` with one stress, or with another for each.
  QuadratureSnapshot snapshot(float way, bool one_stress) const {
    QuadratureSnapshot made;
    for (std::size_t i = 0; i < reference.size(); ++i)
      made.position.push_back(reference[i] + way * static_cast<float>(1 + i % 3));
    for (std::size_t i = 0; i < 2 * reference.size(); ++i)
      made.stress.push_back(static_cast<float>(drawn(one_stress ? i % 6 : i, 3, -100, 100)));
    return made;
  }
  std::vector<QuadratureSnapshot> snapshots(bool one_stress) const {
    return {snapshot(0, one_stress), snapshot(0.0113f, one_stress), snapshot(0.0257f, one_stress)};
  }

  std::vector<double> mass, volume;
  std::vector<float> reference;  ///< [particles, 3]
  rom::Clusters clusters;
};

TEST(NodalSums, OfAllParticlesAsPointsAreExact) {
  const Body body(300, 1);
  const QuadratureError error = NodalSums(body.view(), body.snapshots(false)).error();
  EXPECT_LT(error.mass, 1e-6);
  EXPECT_LT(error.force, 1e-5);
}

TEST(NodalSums, ChosenPointsAreOfTheirClustersAndNearerToAllParticles) {
  const Body body(1600, 8);
  NodalSums sums(body.view(), {body.snapshot(0, true), body.snapshot(0.0113f, true)});
  const QuadratureError before = sums.error();
  sums.choose_points();
  const QuadratureError after = sums.error();
  EXPECT_LT(after.mass, 0.7 * before.mass);
  EXPECT_LT(after.force, 0.7 * before.force);
  ASSERT_EQ(static_cast<int64_t>(sums.points().size()), body.clusters.count);
  for (std::size_t c = 0; c < sums.points().size(); ++c)
    EXPECT_EQ(body.clusters.of_particle[static_cast<std::size_t>(sums.points()[c])], static_cast<int32_t>(c));
  rom::Clusters chosen = body.clusters;
  chosen.points = sums.points();
  const QuadratureBody again{chosen, body.mass, body.volume, {0, 0, 0}, dx};
  const std::vector<QuadratureSnapshot> elsewhere = {body.snapshot(0.0257f, true)};
  EXPECT_LT(NodalSums(again, elsewhere).error().mass, NodalSums(body.view(), elsewhere).error().mass);
}

}  // namespace
}  // namespace graupel::train
