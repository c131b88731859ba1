// The sheet that training runs span in the latent space: a way back to it is straight, and ends on it.
#include "rom/projection/latent_manifold.h"

#include <gtest/gtest.h>

#include <cmath>

namespace graupel::rom {
namespace {

/// Runs of a sheet of time and one parameter, in four latents: (t, mu, bend(t, mu), 0).
template <typename Bend>
LatentManifold sheet(const Bend& bend) {
  std::vector<float> latents;
  std::vector<int32_t> run;
  for (int32_t r = 0; r < 6; ++r)
    for (int step = 0; step < 30; ++step) {
      const double t = 0.1 * step, mu = 0.1 * r;
      for (const double q : {t, mu, bend(t, mu), 0.0}) latents.push_back(static_cast<float>(q));
      run.push_back(r);
    }
  return {latents, 4, run, 2};
}

TEST(LatentManifold, OfAPlaneGivesTheFootOfThePerpendicular) {
  const LatentManifold manifold = sheet([](double t, double mu) { return t + mu; });
  const Eigen::Vector4d foot(1.43, 0.26, 1.69, 0), normal(1, 1, -1, 0), other(0, 0, 0, 1);
  const Eigen::VectorXd found = manifold.project(foot + 0.02 * normal + 0.03 * other);
  EXPECT_LT((found - foot).norm(), 1e-5);
  EXPECT_LT((manifold.project(found) - found).norm(), 1e-5);
}

TEST(LatentManifold, OfABentSheetIsNearIt) {
  const auto bend = [](double t, double mu) { return 0.3 * std::sin(t) + mu * mu; };
  const LatentManifold manifold = sheet(bend);
  const double t = 1.43, mu = 0.26;
  const Eigen::Vector4d on(t, mu, bend(t, mu), 0);
  EXPECT_LT((manifold.project(on) - on).norm(), 0.01);
  Eigen::VectorXd beside = on;
  beside[3] = 0.1;
  EXPECT_LT(std::abs(manifold.project(beside)[3]), 1e-6);
}

TEST(LatentManifold, BetweenRunsIsALineInTheirParameter) {
  // Runs (t, mu), in no order of mu.
  std::vector<float> latents;
  const std::vector<float> values = {3, 1, 2};
  for (const float mu : values)
    for (int step = 0; step < 4; ++step) latents.insert(latents.end(), {static_cast<float>(step), mu * mu});
  const LatentManifold manifold(latents, 2, {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2}, 2);
  for (const auto& [value, squared] : {std::pair{1.0, 1.0}, {1.25, 1.75}, {2.5, 6.5}, {4.0, 14.0}, {0.0, -2.0}}) {
    const Eigen::MatrixXd curve = manifold.between(values, value);
    ASSERT_EQ(curve.cols(), 4);
    for (int step = 0; step < 4; ++step) {
      EXPECT_NEAR(curve(0, step), step, 1e-6);
      EXPECT_NEAR(curve(1, step), squared, 1e-6) << value;
    }
  }
  EXPECT_EQ(manifold.between({1, 2}, 1.5).size(), 0);
  EXPECT_EQ(LatentManifold({0, 1, 2}, 1, {0, 0, 1}, 1).between({1, 2}, 1.5).size(), 0);  // runs of other lengths
}

TEST(LatentManifold, NearestPointOfACurveIsLookedForAroundThePresent) {
  Eigen::MatrixXd curve(2, 21);  // there and back
  for (int i = 0; i <= 20; ++i) curve.col(i) << (i < 10 ? i : 20 - i), 0.1 * i;
  const Eigen::Vector2d q(4.2, 0.5);
  EXPECT_NEAR(nearest_on_curve(curve, q, 4)[1], 0.42, 0.02);
  EXPECT_NEAR(nearest_on_curve(curve, q, 16)[1], 1.58, 0.12);
  EXPECT_EQ(nearest_on_curve(curve, q, 40), q);  // past its end
  const Eigen::VectorXd once = nearest_on_curve(curve, q, 4);
  EXPECT_LT((nearest_on_curve(curve, once, 4) - once).norm(), 1e-12);
}

TEST(LatentManifold, OfOneRunLeavesTheStateWhereItIs) {
  const LatentManifold manifold({0, 0, 0, 1, 1, 1}, 3, {0, 0}, 2);
  const Eigen::Vector3d q(5, -2, 7);
  EXPECT_EQ(manifold.project(q), q);
}

}  // namespace
}  // namespace graupel::rom
