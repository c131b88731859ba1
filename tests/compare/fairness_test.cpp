// Rules of fairness: who is the opponent, and what it is to lose to it.
#include "experiments/fairness.h"

#include <gtest/gtest.h>

namespace graupel::experiments {
namespace {

compare::MetricValues errors(double position, double sinkhorn, double density) {
  return {{"position_mse_all", position}, {"sinkhorn", sinkhorn}, {"density_error", density}};
}

TEST(Fairness, WorseInTwoOfThreeLosesWhateverTheSpeed) {
  const auto opponent = errors(1, 1, 1);
  EXPECT_TRUE(loses(verdicts(errors(2, 2, 0.5), opponent, {})));
  EXPECT_TRUE(loses(verdicts(errors(0.5, 2, 2), opponent, {})));
  EXPECT_FALSE(loses(verdicts(errors(0.5, 0.5, 2), opponent, {})));
  EXPECT_FALSE(loses(verdicts(opponent, opponent, {})));
}

TEST(Fairness, DifferencesWithinTheChaosFloorAreTies) {
  const compare::MetricValues floors = {
      {"floor_position_mse_all", 0.5}, {"floor_sinkhorn", 0.1}, {"floor_density_error", 0}};
  const auto verdict = verdicts(errors(1.4, 0.8, 1.01), errors(1, 1, 1), floors);
  EXPECT_EQ(verdict.at("position_mse_all"), "tie");
  EXPECT_EQ(verdict.at("sinkhorn"), "better");
  EXPECT_EQ(verdict.at("density_error"), "worse");
  EXPECT_FALSE(loses(verdict));
  EXPECT_TRUE(loses(verdicts(errors(1.6, 0.8, 1.01), errors(1, 1, 1), floors)));
}

TEST(Fairness, TheOpponentIsTheCoarseGridAtItsOwnStepUnlessTheOtherWasAskedFor) {
  const auto choices = [](const std::vector<std::string>& words) {
    std::vector<ModelChoice> models;
    for (const std::string& word : words) models.push_back(parse_model(word));
    return models;
  };
  EXPECT_EQ(opponent_of(choices({"mpm"})), mpm::coarse_fast_solver);
  EXPECT_EQ(opponent_of(choices({"mpm:coarse", "mpm:fast"})), mpm::coarse_solver);
  EXPECT_EQ(opponent_of(choices({"mpm:coarse", "mpm:coarse:fast"})), mpm::coarse_fast_solver);
}

}  // namespace
}  // namespace graupel::experiments
