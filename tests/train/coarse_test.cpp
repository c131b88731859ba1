// Training of coarse MPM's constants: a short search on tiny scenes lowers the cost of others.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "core/system/error.h"
#include "io/scene/category_reader.h"
#include "train/coarse/coarse_training.h"

namespace graupel::train {
namespace {

CategoryRecipe tiny() {
  return io::read_category_recipe(
      GRAUPEL_SOURCE_DIR "/scenes/recipes/general.json",
      {"categories=[\"dam_break\"]", "max_particles=600", "domain.sizes=[[1, 1, 1]]", "domain.dx=0.03125"});
}

CoarseTrainingOptions short_search() {
  CoarseTrainingOptions options;
  options.recipe = tiny();
  options.scenes = 4;
  options.valid_scenes = 3;
  options.minutes = 10;
  options.sweeps = 1;
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
  CoarseTrainingOptions options = short_search();
  options.from = stiff_water();
  options.improved = [&](const hybrid::CoarseModel&) { ++improved; };
  const CoarseTrainingResult result = train_coarse(options);
  EXPECT_EQ(result.sweeps, 1);
  EXPECT_LT(result.after.cost, result.before.cost - 0.02);
  EXPECT_GE(improved, 2);  // the first is the start
  EXPECT_GT(result.data_seconds, 0);
  EXPECT_GT(result.seconds, 0);
  EXPECT_LT(result.after.time, 1.1);
  EXPECT_TRUE(result.model.trained.ranges.contains("water.viscosity"));
}

TEST(CoarseTraining, TheSameSeedGivesTheSameModelOnAnyNumberOfThreads) {
  CoarseTrainingOptions options = short_search();
  options.scenes = options.valid_scenes = 2;
  options.frames = 10;
  options.from = stiff_water();
  const auto parameters = [&](int threads) {
    set_num_threads(threads);
    return train_coarse(options).model.parameters();
  };
  const auto one = parameters(1), two = parameters(2);
  set_num_threads(0);
  EXPECT_EQ(one, two);
  EXPECT_NE(one, options.from->parameters());
}

TEST(CoarseTraining, ScenesHaveTheModelsShareOfParticles) {
  CoarseSceneOptions options{.count = 1, .seed = 2, .frames = 10};
  options.resolutions = {1, 2};
  const CoarseScene all = make_coarse_scenes(tiny(), options).at(0);
  for (const MaterialModel law : {MaterialModel::water, MaterialModel::sand, MaterialModel::snow, MaterialModel::jelly})
    options.particle_share[law] = 0.5;
  const CoarseScene half = make_coarse_scenes(tiny(), options).at(0);
  const auto volume = [](const mpm::PreparedScene& scene) {
    double sum = 0;
    for (const double v : scene.particles.volume) sum += v;
    return sum;
  };
  EXPECT_EQ(half.picked[0].size(), all.picked[0].size());
  EXPECT_NEAR(static_cast<double>(half.picked[1].size()), 0.5 * static_cast<double>(all.picked[1].size()), 2);
  EXPECT_EQ(half.picked[1].size(), half.coarse[1].particles.position.size());
  EXPECT_NEAR(volume(half.coarse[1]) / volume(all.coarse[1]), 1, 0.05);
}

TEST(CoarseTraining, ANewModelKeepsTheRulesAndFitsItsSteps) {
  CoarseTrainingOptions options = short_search();
  options.scenes = options.valid_scenes = 2;
  options.frames = 10;
  const hybrid::CoarseModel begins, ends = train_coarse(options).model;
  EXPECT_EQ(ends.log_safety, begins.log_safety);
  EXPECT_EQ(ends.particle_share, begins.particle_share);
  EXPECT_EQ(ends.finest, begins.finest);
  EXPECT_EQ(ends.log_courant.least_speed, begins.log_courant.least_speed);
  EXPECT_NE(ends.log_courant.waves, begins.log_courant.waves);
}

TEST(CoarseTraining, StopsBeforeTheSearchWhenAsked) {
  CoarseTrainingOptions options = short_search();
  options.should_stop = [] { return true; };
  EXPECT_THROW(train_coarse(options), Error);
}

TEST(CoarseTraining, KeepsTheBestModelWhereItIsStoppedWithinARun) {
  CoarseTrainingOptions options = short_search();
  options.scenes = options.valid_scenes = 2;
  options.frames = 10;
  std::atomic<bool> searches = false;
  std::atomic<int> asked = 0;
  options.improved = [&](const hybrid::CoarseModel&) { searches = true; };
  options.should_stop = [&] { return searches && ++asked > 5; };  // fewer than the substeps of the first run
  const CoarseTrainingResult result = train_coarse(options);
  EXPECT_EQ(result.sweeps, 0);
  EXPECT_EQ(result.after.cost, result.before.cost);
}

TEST(CoarseTraining, ARecipeOfStreamsAloneIsRefused) {
  CoarseTrainingOptions options = short_search();
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
