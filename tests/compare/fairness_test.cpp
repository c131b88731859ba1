// Rules of fairness: who is the opponent, and what it is to lose to it.
#include "experiments/comparison/fairness.h"

#include <gtest/gtest.h>

#include "core/system/error.h"
#include "experiments/models/trained_materials.h"

namespace graupel::experiments {
namespace {

using compare::loses;
using compare::verdicts;

compare::MetricValues errors(double position, double sinkhorn, double density) {
  return {{"position_mse_all", position}, {"sinkhorn", sinkhorn}, {"density_error", density}};
}

TEST(Fairness, WorseInTwoOfThreeLosesWhateverTheSpeed) {
  const auto opponent = errors(1, 1, 1);
  const auto floors = compare::deciding_floors({}, 0.02);
  EXPECT_TRUE(loses(verdicts(errors(2, 2, 0.5), opponent, floors)));
  EXPECT_TRUE(loses(verdicts(errors(0.5, 2, 2), opponent, floors)));
  EXPECT_FALSE(loses(verdicts(errors(0.5, 0.5, 2), opponent, floors)));
  EXPECT_FALSE(loses(verdicts(opponent, opponent, floors)));
}

TEST(Fairness, DifferencesBelowTheResolutionAreTiesAlsoWithoutFloors) {
  const auto floors = compare::deciding_floors({{"floor_sinkhorn", 1e-20}, {"floor_density_error", 0.1}}, 0.02);
  EXPECT_DOUBLE_EQ(floors.at("floor_position_mse_all"), 4e-12);  // (1e-4 dx)^2
  EXPECT_DOUBLE_EQ(floors.at("floor_sinkhorn"), 4e-12);
  EXPECT_DOUBLE_EQ(floors.at("floor_density_error"), 0.1);
  const auto verdict = verdicts(errors(0, 0, 0.05), errors(3e-12, 5e-12, 0.15), floors);
  EXPECT_EQ(verdict.at("position_mse_all"), "tie");
  EXPECT_EQ(verdict.at("sinkhorn"), "better");
  EXPECT_EQ(verdict.at("density_error"), "tie");
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

TEST(Fairness, RatiosAreOfWhatIsBeyondTheFloor) {
  compare::MetricValues model = errors(3, 1.05, 0.2), opponent = errors(5, 2, 0.3);
  model["frame_ms"] = 8;
  opponent["frame_ms"] = 2;
  const compare::MetricValues floors = {
      {"floor_position_mse_all", 1}, {"floor_sinkhorn", 1}, {"floor_density_error", 0}};
  const auto ratio = ratios(model, opponent, floors);
  EXPECT_NEAR(ratio.at("ratio_position_mse_all"), 2.0 / 4, 1e-12);
  EXPECT_NEAR(ratio.at("ratio_sinkhorn"), 0.1, 1e-12);  // a tenth of the floor at least
  EXPECT_NEAR(ratio.at("ratio_density_error"), 2.0 / 3, 1e-12);
  EXPECT_NEAR(ratio.at("ratio_frame_ms"), 4, 1e-12);
  for (const auto& [key, value] : ratios(opponent, opponent, floors)) EXPECT_EQ(value, 1) << key;
}

TEST(Fairness, ReducedModelsRunInSpaceWithAFixedSetOfParticles) {
  const ModelChoice reduced{.name = "nsf.safetensors", .kind = ModelKind::reduced}, mpm{.name = "mpm"},
      network{.name = "net.safetensors", .kind = ModelKind::network};
  Scene scene;
  EXPECT_NO_THROW(check_runs_on(reduced, scene));
  scene.emitters.emplace_back();
  EXPECT_THROW(check_runs_on(reduced, scene), ConfigError);
  EXPECT_NO_THROW(check_runs_on(mpm, scene));
  EXPECT_NO_THROW(check_runs_on(network, scene));
  scene.emitters.clear();
  scene.domain.dimensions = 2;
  EXPECT_THROW(check_runs_on(reduced, scene), ConfigError);
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

TEST(Fairness, RunsOnAnotherGridAreJudgedByTracers) {
  EXPECT_FALSE(judged_by_tracers(mpm::same_solver));
  EXPECT_FALSE(judged_by_tracers(mpm::fast_solver));
  for (const auto& variant : {mpm::coarse_solver, mpm::coarse_fast_solver, mpm::fine_solver})
    EXPECT_TRUE(judged_by_tracers(variant));
}

TEST(UnknownWalls, AreNamedWithTheirFrictionAndWhereTheyStick) {
  nn::Weights weights;
  Scene scene;
  scene.domain.wall_friction = 0.35;
  EXPECT_TRUE(unknown_walls(weights, scene).empty());  // weights that do not say what they were taught
  weights.metadata["training.materials"] = "{}";
  ASSERT_EQ(unknown_walls(weights, scene).size(), 1u);
  EXPECT_NE(unknown_walls(weights, scene)[0].find("walls is 0.35"), std::string::npos);
  scene.domain.wall_friction = 0;
  EXPECT_TRUE(unknown_walls(weights, scene).empty());
  Obstacle ball;
  ball.friction = 0.2;
  scene.obstacles.push_back(ball);
  ASSERT_EQ(unknown_walls(weights, scene).size(), 1u);
  EXPECT_NE(unknown_walls(weights, scene)[0].find("obstacles is 0.2"), std::string::npos);
  scene.obstacles.clear();
  scene.domain.walls = Contact::stick;
  ASSERT_EQ(unknown_walls(weights, scene).size(), 1u);
  EXPECT_NE(unknown_walls(weights, scene)[0].find("sticky"), std::string::npos);
  scene.domain.walls = Contact::separate;
  scene.sinks.emplace_back();
  ASSERT_EQ(unknown_walls(weights, scene).size(), 1u);
  EXPECT_NE(unknown_walls(weights, scene)[0].find("come or go"), std::string::npos);
}

}  // namespace
}  // namespace graupel::experiments
