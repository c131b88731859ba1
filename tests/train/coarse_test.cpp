// Training of coarse MPM's constants: the evolution finds minima, and a short training of tiny scenes lowers its cost.
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "io/scene/category_reader.h"
#include "train/coarse/cma_es.h"
#include "train/coarse/coarse_training.h"

namespace graupel::train {
namespace {

/// sum of (i-th coordinate - i)^2 10^(6 i / (n - 1)): axes that differ a thousandfold in length.
double ellipsoid(const std::vector<double>& x) {
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    sum += std::pow(x[i] - static_cast<double>(i), 2) *
           std::pow(10, 6.0 * static_cast<double>(i) / static_cast<double>(x.size() - 1));
  return sum;
}

TEST(CmaEs, FindsTheMinimumOfAnEllipsoid) {
  constexpr std::size_t n = 8;
  CmaEs evolution(std::vector<double>(n, 3.0), std::vector<double>(n, 1.0), 12, 1);
  for (int generation = 0; generation < 600; ++generation) {
    std::vector<double> costs;
    for (const auto& x : evolution.sample()) costs.push_back(ellipsoid(x));
    evolution.update(costs);
  }
  EXPECT_LT(ellipsoid(evolution.mean()), 1e-12);
}

TEST(CmaEs, ACostThatIsNoNumberRanksLastAndSeedsRepeat) {
  CmaEs one({0, 0}, {1, 1}, 8, 5), same({0, 0}, {1, 1}, 8, 5), other({0, 0}, {1, 1}, 8, 6);
  EXPECT_EQ(one.sample(), same.sample());
  EXPECT_NE(one.sample(), other.sample());
  for (int generation = 0; generation < 60; ++generation) {
    std::vector<double> costs;
    for (const auto& x : one.sample()) costs.push_back(x[0] < 1 ? std::nan("") : x[0] * x[0] + x[1] * x[1]);
    one.update(costs);
  }
  EXPECT_NEAR(one.mean()[0], 1, 0.05);
}

CategoryRecipe tiny() {
  return io::read_category_recipe(
      GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json",
      {"categories=[\"dam_break\"]", "max_particles=600", "domain.sizes=[[1, 1, 1]]", "domain.dx=0.03125"});
}

CoarseTrainingOptions few_generations() {
  CoarseTrainingOptions options;
  options.recipe = tiny();
  options.scenes = 4;
  options.valid_scenes = options.scenes_a_step = 3;
  options.candidates = 6;
  options.minutes = 10;
  options.generations = 20;
  options.frames = 40;
  options.seed = 2;
  return options;
}

/// Water four times as stiff as the scene's.
hybrid::CoarseModel stiff_water() {
  hybrid::CoarseModel model;
  std::vector<double> values = model.parameters();
  values[0] = std::log(4);
  model.set_parameters(values);
  return model;
}

TEST(CoarseTraining, LowersTheCostOfScenesThatItWasNotTrainedOn) {
  ASSERT_EQ(hybrid::CoarseModel::parameter_names().front(), "water.bulk_modulus.offset");
  int improved = 0;
  CoarseTrainingOptions options = few_generations();
  options.from = stiff_water();
  options.improved = [&](const hybrid::CoarseModel&) { ++improved; };
  const CoarseTrainingResult result = train_coarse(options);
  EXPECT_EQ(result.generations, 20);
  EXPECT_LT(result.after.cost, result.before.cost - 0.02);
  EXPECT_GE(improved, 1);
  EXPECT_LT(result.after.time, 1.1);
  EXPECT_TRUE(result.model.ranges.contains("water.viscosity"));
}

TEST(CoarseTraining, TheSameSeedGivesTheSameModelOnAnyNumberOfThreads) {
  CoarseTrainingOptions options = few_generations();
  options.generations = 1;
  options.scenes = options.valid_scenes = 2;
  options.frames = 10;
  const auto parameters = [&](int threads) {
    set_num_threads(threads);
    return train_coarse(options).model.parameters();
  };
  const auto one = parameters(1), two = parameters(2);
  set_num_threads(0);
  EXPECT_EQ(one, two);
}

TEST(CoarseTraining, ARecipeOfStreamsAloneIsRefused) {
  CoarseTrainingOptions options = few_generations();
  options.recipe = io::read_category_recipe(GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json",
                                            {"categories=[\"stream\"]", "max_particles=600"});
  try {
    train_coarse(options);
    FAIL() << "no error";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("gives no scenes to train on"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace graupel::train
