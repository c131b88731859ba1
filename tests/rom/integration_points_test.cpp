// Integration points: no particle that reaches a sample's nodes is missing; clusters keep mass and mean stress.
#include "rom/solver/integration_points.h"
#include "rom/fields/tiled_modes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/math/random.h"
#include "core/system/error.h"
#include "mpm/physics/stencil.h"
#include "rom/cubature/quadrature.h"
#include "rom/fields/factored_fields.h"
#include "rom/reduced_solver.h"
#include "tests/rom/swaying_model.h"

namespace graupel::rom {
namespace {

constexpr int count = 3000;

std::vector<Vec3f> random_points() {
  const Random random(4, RandomPurpose::test);
  std::vector<Vec3f> x(count);
  for (std::size_t i = 0; i < x.size(); ++i)
    for (int d = 0; d < 3; ++d) x[i][d] = static_cast<float>(random.uniform(i, d, 0.1, 0.5));
  return x;
}

/// A body that the one latent moves along x; stress and affine velocity are the particle's number.
FactoredFields sliding(const std::vector<Vec3f>& x) {
  const auto table = [&](int components) {
    ModeTable t;
    t.components = components;
    t.modes = 1;
    t.points.resize(x.size());
    std::iota(t.points.begin(), t.points.end(), 0);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (int c = 0; c < components; ++c) {
        t.mean.push_back(components == 3 ? x[i][c] : static_cast<float>(i));
        t.basis.push_back(components == 3 && c == 0 ? 1.0f : 0.0f);
      }
    return t;
  };
  const CoefficientMap constant(1, 1, {0}, {1}, {}, {}, {1, 0});
  return {table(3), ClosureBranch(1, CoefficientMap(1, 0, {0}, {1}, {}, {}, {})),
          table(6), MapBranch(constant),
          table(9), std::make_shared<const MapBranch>(constant)};
}

TEST(IntegrationPoints, ContainEveryParticleThatSharesANodeWithASample) {
  const std::vector<Vec3f> x = random_points();
  const FactoredFields fields = sliding(x);
  Domain domain;
  domain.size = {0.8, 0.6, 0.6};
  domain.dx = 0.02;
  const auto grid = mpm::grid_of<float>(domain);
  GridParticles all;  // neighbours after each other
  all.particles = make_clusters(x, std::vector<int32_t>(x.size(), 0), 1).representatives();
  all.weight.assign(x.size(), 1);
  const std::vector<int32_t> samples = {7, 500, 2999};
  IntegrationPoints<float> points(fields, all, samples, grid);
  for (const double q : {0.0, 0.03, 0.17}) {
    const std::vector<int32_t> tiles =
        points.find({.latent = {q}, .velocity = {0}, .parameters = {}, .last_step = 0, .previous = {}});
    GridParticles found;
    for (const int32_t t : tiles)
      for (std::size_t i = 16 * static_cast<std::size_t>(t);
           i < std::min<std::size_t>(16 * static_cast<std::size_t>(t) + 16, x.size()); ++i) {
        found.particles.push_back(points.candidates().particles[i]);
        found.weight.push_back(points.candidates().weight[i]);
      }
    ASSERT_EQ(points.candidates().samples, 3);
    EXPECT_TRUE(std::equal(samples.begin(), samples.end(), found.particles.begin()));
    EXPECT_LT(found.particles.size(), x.size() / 2);
    const auto base = [&](int32_t p) {
      return mpm::base_node(grid.local(x[static_cast<std::size_t>(p)] + Vec3f{static_cast<float>(q), 0, 0}));
    };
    for (int32_t p = 0; p < count; ++p) {
      const bool reaches = std::any_of(samples.begin(), samples.end(), [&](int32_t s) {
        const Vec<int, 3> a = base(p), b = base(s);
        return std::abs(a[0] - b[0]) <= 2 && std::abs(a[1] - b[1]) <= 2 && std::abs(a[2] - b[2]) <= 2;
      });
      if (!reaches) continue;
      double weight = 0;
      for (std::size_t i = 0; i < found.particles.size(); ++i)
        if (found.particles[i] == p) weight += found.weight[i];
      EXPECT_EQ(weight, 1) << "particle " << p << " at q = " << q;
    }
  }
}

TEST(Clusters, AreSmallCompactAndOfOneKind) {
  const std::vector<Vec3f> x = random_points();
  std::vector<int32_t> kind(x.size());
  for (std::size_t i = 0; i < kind.size(); ++i) kind[i] = x[i][1] > 0.3f ? 5 : 2;
  const Clusters clusters = make_clusters(x, kind, 4);
  const std::vector<int32_t> chosen = clusters.representatives();
  std::vector<int> members(chosen.size(), 0);
  for (std::size_t p = 0; p < x.size(); ++p) {
    const auto c = static_cast<std::size_t>(clusters.of_particle[p]);
    ++members[c];
    EXPECT_EQ(kind[p], kind[static_cast<std::size_t>(chosen[c])]);
    EXPECT_LT(norm(x[p] - x[static_cast<std::size_t>(chosen[c])]), 0.15);  // particles are some 0.028 apart
  }
  EXPECT_LE(*std::max_element(members.begin(), members.end()), 4);
  EXPECT_GE(*std::min_element(members.begin(), members.end()), 2);
  EXPECT_EQ(make_clusters(x, kind, 1).count, count);
}

TEST(Clusters, RepresentativesCarryTheMeanStress) {
  const std::vector<Vec3f> x = random_points();
  const FactoredFields fields = sliding(x);
  const Clusters clusters = make_clusters(x, std::vector<int32_t>(x.size()), 5);
  const FactoredFields clustered = fields.clustered(clusters);
  std::vector<double> sum(static_cast<std::size_t>(clusters.count)), members(sum.size());
  for (std::size_t p = 0; p < x.size(); ++p) {
    sum[static_cast<std::size_t>(clusters.of_particle[p])] += static_cast<double>(p);
    members[static_cast<std::size_t>(clusters.of_particle[p])] += 1;
  }
  const std::vector<int32_t> chosen = clusters.representatives();
  for (std::size_t c = 0; c < chosen.size(); ++c) {
    const int64_t row = clustered.stress().row_of(chosen[c]);
    ASSERT_GE(row, 0);
    EXPECT_NEAR(static_cast<double>(clustered.stress().mean[static_cast<std::size_t>(6 * row)]), sum[c] / members[c],
                1e-3);
  }
}

TEST(Clusters, DamagedPointsAreRefused) {
  ReducedModel model = test::swaying_model(test::swaying_scene());
  const auto stored = [&] { return model.store(nn::DType::f32); };
  model.clusters.points = model.clusters.representatives();
  EXPECT_NO_THROW(ReducedModel::load(stored()));
  std::swap(model.clusters.points[0], model.clusters.points[1]);
  EXPECT_THROW(ReducedModel::load(stored()), InputError);
  model.clusters.points = {model.clusters.points[1]};
  EXPECT_THROW(ReducedModel::load(stored()), InputError);
}

/// What files of earlier versions may have and this one no longer follows is named; a factor of 0 is as none.
TEST(Clusters, FilesThatNeedWhatWasRemovedAreRefusedByName) {
  const ReducedModel model = test::swaying_model(test::swaying_scene());
  const nn::Weights stored = model.store(nn::DType::f32);
  const auto refusal = [](const nn::Weights& weights) -> std::string {
    try {
      ReducedModel::load(weights);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const auto with_factor = [&](const std::string& factor) {
    nn::Weights weights = stored;
    std::string& settings = weights.metadata["settings"];
    settings.insert(1, "\"outlier_factor\":" + factor + ",");
    return weights;
  };
  EXPECT_EQ(refusal(with_factor("0.0")), "");
  EXPECT_NE(refusal(with_factor("3.0")).find("outlier_factor"), std::string::npos);
  for (const auto& [tensor, key] : {std::pair{"quadrature", "quadrature"}, {"samples.later", "sample_windows"}}) {
    nn::Weights weights = stored;
    weights.tensors[tensor] = nn::Tensor::from_float({1.0f}, {1});
    EXPECT_NE(refusal(weights).find(key), std::string::npos) << refusal(weights);
  }
}

/// Three components of two points, with three modes.
ModeTable small_table() {
  ModeTable table;
  table.components = 3;
  table.modes = 3;
  table.points = {4, 9};
  table.mean = {1, 2, 0, 3, 4, 0};
  table.basis = {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0.5};
  return table;
}

TEST(TiledModes, GiveMeanPlusModesAndZeroWhereTheTableHasNoRow) {
  TiledModes<double> modes;
  modes.assign(small_table(), {9, 4, 5}, {1, 0, 2});
  const double a[] = {10, 20, 30}, rate[] = {1, 2, 3};
  std::vector<double> values(48), rates(48);
  modes.set_coefficients(a);
  modes.set_rates(rate);
  modes.evaluate(0, values.data(), rates.data());
  const double expected[3][3] = {{4 + 60, 2 + 20, 0}, {3 + 30, 1 + 10, 0}, {15, 0, 0}};
  for (int c = 0; c < 3; ++c)
    for (int s = 0; s < 3; ++s) EXPECT_EQ(values[static_cast<std::size_t>(16 * c + s)], expected[c][s]);
  EXPECT_EQ(rates[0], 6);
  EXPECT_EQ(rates[16], 3);
}

TEST(TiledModes, OfSixteenBitsAreThoseOfTheWeightsFile) {
  ModeTable table = small_table();
  for (float& w : table.basis) w = 0.3f * w + 0.01f;
  nn::Weights weights;
  table.store(weights, "x", nn::DType::f16);
  const ModeTable stored = ModeTable::load(weights, "x", 3);
  ASSERT_EQ(stored.precision, ModePrecision::half);
  ModeTable wide = stored;
  wide.precision = ModePrecision::full;
  TiledModes<float> half, full;
  half.assign(stored, {9, 4}, {0, 1, 2});
  full.assign(wide, {9, 4}, {0, 1, 2});
  EXPECT_LT(half.bytes(), full.bytes());
  const double a[] = {10, 20, 30};
  std::vector<float> values(48), expected(48);
  half.set_coefficients(a);
  full.set_coefficients(a);
  half.evaluate(0, values.data());
  full.evaluate(0, expected.data());
  for (std::size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-5);
}

}  // namespace
}  // namespace graupel::rom
