// Points and weights of clusters: sums at grid nodes that the points can represent are found again, weights are not
// negative and keep the mass, and points that are chosen are nearer to all particles than random ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/random.h"
#include "train/grid_sums.h"

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
  std::vector<double> ones() const { return std::vector<double>(static_cast<std::size_t>(clusters.count), 1.0); }

  std::vector<double> mass, volume;
  std::vector<float> reference;  ///< [particles, 3]
  rom::Clusters clusters;
};

TEST(GridSums, OfAllParticlesAsPointsAreExact) {
  const Body body(300, 1);
  const QuadratureError error = GridSums(body.view(), body.snapshots(false)).error(body.ones());
  EXPECT_LT(error.mass, 1e-6);
  EXPECT_LT(error.force, 1e-5);
}

TEST(GridSums, WeightsThatRepresentTheSumsAreFound) {
  Body body(240, 3);
  // Every particle that is no point lies at the point of some cluster, so that its weight is known.
  const std::vector<int32_t> points = body.clusters.representatives();
  std::vector<double> there(points.size(), 1.0), members(points.size(), 0.0);
  for (std::size_t p = 0; p < body.mass.size(); ++p) {
    const auto own = static_cast<std::size_t>(body.clusters.of_particle[p]);
    members[own] += 1;
    if (points[own] == static_cast<int32_t>(p)) continue;
    const auto c = static_cast<std::size_t>(drawn(p, 2, 0, 1) * static_cast<double>(points.size()));
    there[c] += 1;
    std::copy_n(body.reference.begin() + 3 * points[c], 3, body.reference.begin() + static_cast<int64_t>(3 * p));
  }
  const GridSums sums(body.view(), body.snapshots(true));
  const std::vector<double> weights = sums.fit_weights();
  EXPECT_GT(sums.error(body.ones()).mass, 0.1);
  EXPECT_LT(sums.error(weights).mass, 0.02);
  EXPECT_LT(sums.error(weights).force, 0.05);
  double error2 = 0, size2 = 0;
  for (std::size_t c = 0; c < points.size(); ++c) {
    error2 += std::pow(weights[c] - there[c] / members[c], 2);
    size2 += std::pow(1 - there[c] / members[c], 2);
  }
  EXPECT_LT(error2, 1e-2 * size2);
}

TEST(GridSums, WeightsKeepTheMassAndLessenTheErrors) {
  const Body body(800, 8);
  const GridSums sums(body.view(), body.snapshots(false));
  const std::vector<double> fitted = sums.fit_weights(), weights = with_total_mass(body.view(), fitted);
  EXPECT_GE(*std::min_element(weights.begin(), weights.end()), 0);
  double mass = 0;
  for (std::size_t p = 0; p < body.mass.size(); ++p)
    mass += body.mass[p] * weights[static_cast<std::size_t>(body.clusters.of_particle[p])];
  EXPECT_NEAR(mass, std::accumulate(body.mass.begin(), body.mass.end(), 0.0), 1e-12);
  EXPECT_LT(sums.error(fitted).mass, sums.error(body.ones()).mass);
  EXPECT_LT(sums.error(fitted).force, sums.error(body.ones()).force);
}

TEST(GridSums, WeightsThatWouldBeNegativeAreZero) {
  Body body(8, 4);
  ASSERT_EQ(body.clusters.count, 2);
  // The point of cluster 0 has hardly any mass, lies alone and is pulled where the rest of its cluster is pressed.
  const int32_t alone = body.clusters.representatives()[0];
  body.mass[static_cast<std::size_t>(alone)] = 1e-9;
  for (std::size_t d = 0; d < 3; ++d) body.reference[3 * static_cast<std::size_t>(alone) + d] = 0.6f;
  QuadratureSnapshot state = body.snapshot(0, false);
  for (std::size_t p = 0; p < body.mass.size(); ++p)
    for (std::size_t k = 0; k < 6; ++k) state.stress[6 * p + k] = static_cast<int32_t>(p) == alone ? 50.0f : -50.0f;
  const std::vector<double> weights = GridSums(body.view(), {state}).fit_weights();
  EXPECT_EQ(weights[0], 0);
  EXPECT_GT(weights[1], 0);
}

TEST(GridSums, ChosenPointsAreOfTheirClustersAndNearerToAllParticles) {
  const Body body(1600, 8);
  GridSums sums(body.view(), {body.snapshot(0, true), body.snapshot(0.0113f, true)});
  const QuadratureError before = sums.error(body.ones());
  sums.choose_points();
  const QuadratureError after = sums.error(body.ones());
  EXPECT_LT(after.mass, 0.7 * before.mass);
  EXPECT_LT(after.force, 0.7 * before.force);
  ASSERT_EQ(static_cast<int64_t>(sums.points().size()), body.clusters.count);
  for (std::size_t c = 0; c < sums.points().size(); ++c)
    EXPECT_EQ(body.clusters.of_particle[static_cast<std::size_t>(sums.points()[c])], static_cast<int32_t>(c));
  rom::Clusters chosen = body.clusters;
  chosen.points = sums.points();
  const QuadratureBody again{chosen, body.mass, body.volume, {0, 0, 0}, dx};
  const std::vector<QuadratureSnapshot> elsewhere = {body.snapshot(0.0257f, true)};
  EXPECT_LT(GridSums(again, elsewhere).error(body.ones()).mass,
            GridSums(body.view(), elsewhere).error(body.ones()).mass);
}

}  // namespace
}  // namespace graupel::train
