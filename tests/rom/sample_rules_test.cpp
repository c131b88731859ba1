// Sample rules: what each rule promises of the samples that it chooses.
#include "rom/cubature/sample_selection.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace graupel::rom {
namespace {

TEST(SampleRules, TakeSoManyDifferentCandidatesInAscendingOrder) {
  const std::vector<int32_t> candidates = {40, 3, 17, 9, 58, 22, 31, 5, 11, 50};
  for (const SampleRule rule : {SampleRule::random, SampleRule::spread, SampleRule::patches}) {
    const std::vector<int32_t> samples = choose_samples(rule, candidates, 4, 1);
    ASSERT_EQ(samples.size(), 4u);
    EXPECT_TRUE(std::is_sorted(samples.begin(), samples.end()));
    EXPECT_EQ(std::adjacent_find(samples.begin(), samples.end()), samples.end());
    for (const int32_t s : samples) EXPECT_NE(std::find(candidates.begin(), candidates.end(), s), candidates.end());
    EXPECT_EQ(choose_samples(rule, candidates, 99, 1).size(), candidates.size());
  }
  EXPECT_EQ(choose_samples(SampleRule::spread, {0, 1, 2, 3, 4, 5}, 3, 1), (std::vector<int32_t>{0, 2, 4}));
  EXPECT_NE(choose_samples(SampleRule::random, candidates, 4, 1), choose_samples(SampleRule::random, candidates, 4, 2));
}

TEST(SampleRules, ABoxKeepsThePointsInsideInTheirOrder) {
  const std::vector<float> reference = {0, 0, 0, 1, 1, 1, 2, 0, 0, 0.5f, 0.5f, 0.5f};
  EXPECT_EQ(points_within({3, 2, 1, 0}, reference, {0, 0, 0}, {1, 1, 1}), (std::vector<int32_t>{3, 1, 0}));
  EXPECT_TRUE(points_within({0, 1, 2, 3}, reference, {5, 5, 5}, {6, 6, 6}).empty());
}

}  // namespace
}  // namespace graupel::rom
