// Sample rules: what each rule promises of the samples that it chooses.
#include "rom/sample_rules.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>

#include "core/random.h"

namespace graupel::rom {
namespace {

constexpr int particles = 60, modes = 4;

ModeTable random_modes() {
  ModeTable table;
  table.components = 3;
  table.modes = modes;
  const Random random(8, RandomPurpose::test);
  for (int32_t p = 0; p < particles; ++p) table.points.push_back(p);
  table.mean.assign(3 * particles, 0.0f);
  for (uint64_t i = 0; i < 3 * particles * modes; ++i)
    table.basis.push_back(static_cast<float>(random.uniform(i, 0, -1, 1)));
  return table;
}

/// det(U_S^T U_S): how well the samples tell the modes apart.
double information(const ModeTable& table, const std::vector<int32_t>& samples) {
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(modes, modes);
  for (const int32_t s : samples) {
    using Rows = Eigen::Matrix<float, 3, modes, Eigen::RowMajor>;
    const Eigen::MatrixXd u = Eigen::Map<const Rows>(table.basis.data() + 3 * modes * s).cast<double>();
    gram += u.transpose() * u;
  }
  return gram.determinant();
}

TEST(SampleRules, TakeSoManyDifferentCandidatesInAscendingOrder) {
  const ModeTable table = random_modes();
  const std::vector<int32_t> candidates = {40, 3, 17, 9, 58, 22, 31, 5, 11, 50};
  for (const SampleRule rule : {SampleRule::random, SampleRule::spread, SampleRule::optimal}) {
    const std::vector<int32_t> samples = choose_samples(rule, table, candidates, 4, 1);
    ASSERT_EQ(samples.size(), 4u);
    EXPECT_TRUE(std::is_sorted(samples.begin(), samples.end()));
    EXPECT_EQ(std::adjacent_find(samples.begin(), samples.end()), samples.end());
    for (const int32_t s : samples) EXPECT_NE(std::find(candidates.begin(), candidates.end(), s), candidates.end());
    EXPECT_EQ(choose_samples(rule, table, candidates, 99, 1).size(), candidates.size());
  }
  EXPECT_EQ(choose_samples(SampleRule::spread, table, {0, 1, 2, 3, 4, 5}, 3, 1), (std::vector<int32_t>{0, 2, 4}));
  EXPECT_NE(choose_samples(SampleRule::random, table, candidates, 4, 1),
            choose_samples(SampleRule::random, table, candidates, 4, 2));
}

TEST(SampleRules, OptimalSamplesTellTheModesApartBest) {
  const ModeTable table = random_modes();
  const double optimal = information(table, choose_samples(SampleRule::optimal, table, table.points, 4, 0));
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8})
    EXPECT_GT(optimal, information(table, choose_samples(SampleRule::random, table, table.points, 4, seed)));
}

TEST(SampleRules, ABoxKeepsThePointsInsideInTheirOrder) {
  const std::vector<float> reference = {0, 0, 0, 1, 1, 1, 2, 0, 0, 0.5f, 0.5f, 0.5f};
  EXPECT_EQ(points_within({3, 2, 1, 0}, reference, {0, 0, 0}, {1, 1, 1}), (std::vector<int32_t>{3, 1, 0}));
  EXPECT_TRUE(points_within({0, 1, 2, 3}, reference, {5, 5, 5}, {6, 6, 6}).empty());
}

}  // namespace
}  // namespace graupel::rom
