// Coarse MPM with trained constants: the grid, the constants, the step and the file of a model.
#include "hybrid/coarse_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/system/error.h"
#include "mpm/scene_variants.h"
#include "mpm/simulation.h"
#include "tests/mpm/test_scenes.h"

namespace graupel::hybrid {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Without the rules that are chosen by hand.
CoarseModel without_rules() {
  CoarseModel model;
  model.log_safety.clear();
  model.log_courant.least_speed.clear();
  model.finest.clear();
  model.particle_share.clear();
  return model;
}

/// That with one parameter changed.
CoarseModel with(const std::string& name, double value) {
  CoarseModel model = without_rules();
  std::vector<double> values = model.parameters();
  const auto& names = CoarseModel::parameter_names();
  const auto found = std::find(names.begin(), names.end(), name);
  EXPECT_NE(found, names.end()) << name;
  values[static_cast<std::size_t>(found - names.begin())] = value;
  model.set_parameters(values);
  return model;
}

TEST(CoarseModel, AtTheScenesOwnSpacingWithoutTrainingItChangesTheStepAlone) {
  Scene scene = mpm::four_materials();
  const Scene own = CoarseModel().scene(scene, 1.0);
  scene.time_step.substeps_per_frame = own.time_step.substeps_per_frame;
  const auto run = mpm::Simulation::create(own, {}), expected = mpm::Simulation::create(scene, {});
  for (int f = 0; f < 3; ++f) {
    run->advance_frame();
    expected->advance_frame();
  }
  EXPECT_EQ(run->frame().position, expected->frame().position);
}

TEST(CoarseModel, StiffnessIsReplacedAndTheStepFollowsIt) {
  Scene scene = mpm::scene_with("taichi_water");
  scene.gravity = {0, 0, 0};  // no fall, whose speed would set the step
  const auto own = without_rules().scene(scene, 2.0);
  const auto soft = with("water.bulk_modulus.offset", -std::log(4)).scene(scene, 2.0);
  const auto bulk_modulus = [](const Scene& s) { return s.materials.begin()->second.bulk_modulus; };
  EXPECT_NEAR(bulk_modulus(soft) / bulk_modulus(scene), 0.25, 1e-12);
  EXPECT_DOUBLE_EQ(bulk_modulus(own), bulk_modulus(scene));
  EXPECT_NEAR(
      static_cast<double>(soft.time_step.substeps_per_frame) / static_cast<double>(own.time_step.substeps_per_frame),
      0.5, 0.05);
}

TEST(CoarseModel, ASlopeHasNoEffectAtTheReference) {
  const CoarseModel model = with("sand.friction_angle.slope", 0.5);
  const auto angle = [&](double degrees) {
    MaterialConfig sand = mpm::preset("taichi_sand");
    sand.friction_angle = degrees;
    return model.constants.material(sand).friction_angle;
  };
  EXPECT_NEAR(angle(32), 32, 1e-9);
  EXPECT_GT(angle(40), 40);
  EXPECT_LT(angle(25), 25);
  const double tangent = std::tan(40 * std::numbers::pi / 180), reference = std::tan(32 * std::numbers::pi / 180);
  EXPECT_NEAR(std::tan(angle(40) * std::numbers::pi / 180), tangent * std::sqrt(tangent / reference), 1e-9);
}

TEST(CoarseModel, WallsTakeTheirFactorAndObstaclesKeepTheirFriction) {
  Scene scene = mpm::four_materials();
  scene.domain.wall_friction = 0.4;
  scene.domain.faces.y_low = WallConfig{.friction = 0.2};
  const Scene changed = with("walls.friction.offset", std::log(1.5)).scene(scene, 1.0);
  EXPECT_NEAR(changed.domain.friction(0, 0), 0.6, 1e-12);
  EXPECT_NEAR(changed.domain.friction(1, 0), 0.3, 1e-12);
  EXPECT_EQ(changed.obstacles[0].friction, scene.obstacles[0].friction);
}

TEST(CoarseModel, WhatSofterMatterSavesIsSpentOnAFinerGrid) {
  Scene scene = mpm::scene_with("taichi_water");
  scene.gravity = {0, 0, 0};
  CoarseModel own = without_rules();
  own.log_safety[MaterialModel::water] = 0.15;
  EXPECT_NEAR(own.cost(scene, 2, Device::cuda), std::exp(0.15), 0.05);
  own.log_safety.clear();
  EXPECT_EQ(own.resolution(scene, Device::cuda), 2);
  EXPECT_NEAR(own.cost(scene, 2, Device::cpu), 1, 1e-12);
  const CoarseModel soft = with("water.bulk_modulus.offset", -std::log(4));
  const double on_gpu = soft.resolution(scene, Device::cuda), on_cpu = soft.resolution(scene, Device::cpu);
  EXPECT_LT(on_gpu, on_cpu);
  EXPECT_LT(on_cpu, 2);
  EXPECT_LE(soft.cost(scene, on_gpu, Device::cuda), 1);
  EXPECT_LE(soft.cost(scene, on_cpu, Device::cpu), 1);
  EXPECT_NEAR(soft.scene(scene, on_gpu).domain.dx, on_gpu * scene.domain.dx, 1e-12);
  const CoarseModel stiff = with("water.bulk_modulus.offset", std::log(4));  // the coarsest, though it costs more
  EXPECT_EQ(stiff.resolution(scene, Device::cpu), stiff.resolutions.back());
  EXPECT_GT(stiff.cost(scene, stiff.resolutions.back(), Device::cpu), 1);
}

TEST(CoarseModel, AFrameTakesTimeBesideItsSubsteps) {
  Scene scene = mpm::scene_with("taichi_water");
  scene.gravity = {0, 0, 0};
  CoarseModel soft = with("water.bulk_modulus.offset", -std::log(16));
  const auto cost = [&](double frame) {
    soft.frame_cost[Device::cpu].frame = frame;
    return soft.cost(scene, 2, Device::cpu);
  };
  const auto few = static_cast<double>(soft.wave_substeps(soft.scene(scene, 2))),
             many = static_cast<double>(soft.opponent_substeps(scene));
  EXPECT_LT(few, many / 2);
  EXPECT_NEAR(cost(0), few / many, 1e-12);
  EXPECT_NEAR(cost(4), (few + 4) / (many + 4), 1e-12);
  EXPECT_NEAR(soft.cost(scene, 2, Device::cpu, 50), (few + 4) / (50 + 4), 1e-12);
}

TEST(CoarseModel, TheOpponentsSubstepsAreThoseOfTheMean) {
  const Scene water = mpm::scene_with("taichi_water"), sand = mpm::scene_with("taichi_sand");
  CoarseModel model;
  EXPECT_EQ(model.opponent_substeps(sand), model.largest_step_substeps(mpm::on_coarser_grid(sand, 2)));
  const auto fitted = static_cast<double>(model.opponent_substeps(sand));
  const int64_t of_water = model.opponent_substeps(water);
  const double before = model.cost(sand, 2, Device::cuda);
  model.log_opponent[MaterialModel::sand] = std::log(2);
  EXPECT_NEAR(static_cast<double>(model.opponent_substeps(sand)), 2 * fitted, 1);
  EXPECT_EQ(model.opponent_substeps(water), of_water);
  EXPECT_NEAR(model.cost(sand, 2, Device::cuda), before / 2, 0.05 * before);
}

TEST(CoarseModel, PeriodicWallsRoundTheSpacingOfThePrediction) {
  Scene scene = mpm::scene_with("taichi_sand");
  scene.gravity = {0, 0, 0};
  const CoarseModel model = without_rules();
  const double free = model.cost(scene, 1.5, Device::cuda);
  scene.domain.faces.x_low = scene.domain.faces.x_high = WallConfig{.kind = Wall::periodic, .friction = {}};
  const Scene coarse = model.scene(scene, 1.5), opponent = mpm::on_coarser_grid(scene, 2);
  ASSERT_NE(coarse.domain.dx, 1.5 * scene.domain.dx);
  EXPECT_NEAR(model.cost(scene, 1.5, Device::cuda),
              static_cast<double>(coarse.time_step.substeps_per_frame) /
                  static_cast<double>(model.largest_step_substeps(opponent)) *
                  std::pow(opponent.domain.dx / coarse.domain.dx, model.frame_cost.at(Device::cuda).spacing),
              1e-12);
  EXPECT_NE(model.cost(scene, 1.5, Device::cuda), free);
}

double mass_of(const Scene& scene) { return mpm::Simulation::create(scene, {})->diagnostics().mass; }
std::size_t particles_of(const Scene& scene) { return mpm::Simulation::create(scene, {})->particle_count(); }

TEST(CoarseModel, FewerParticlesACellAreHeavierAndBuyAFinerGrid) {
  const Scene scene = mpm::scene_with("taichi_sand", {0.3, 0.3, 0.3});
  CoarseModel all = without_rules(), half = all;
  half.particle_share[MaterialModel::sand] = 0.5;
  const Scene many = all.scene(scene, 1.5), few = half.scene(scene, 1.5);
  EXPECT_NEAR(static_cast<double>(particles_of(few)) / static_cast<double>(particles_of(many)), 0.5, 0.02);
  EXPECT_NEAR(mass_of(few) / mass_of(many), 1, 0.02);
  EXPECT_EQ(particles_of(half.scene(scene, 1)), particles_of(scene));  // its own particles
  EXPECT_NEAR(half.cost(scene, 1.5, Device::cpu) / all.cost(scene, 1.5, Device::cpu),
              std::pow(0.5, all.frame_cost.at(Device::cpu).share), 1e-12);
  EXPECT_LT(half.resolution(scene, Device::cpu), all.resolution(scene, Device::cpu));
  EXPECT_EQ(particles_of(half.scene(mpm::scene_with("taichi_jelly"), 1.5)),
            particles_of(all.scene(mpm::scene_with("taichi_jelly"), 1.5)));
}

TEST(CoarseModel, AGridHasNoMoreParticlesThanTheScene) {
  const Scene scene = mpm::scene_with("taichi_water", {0.3, 0.3, 0.3});
  CoarseModel model;
  model.particle_share[MaterialModel::water] = 8;
  EXPECT_NEAR(static_cast<double>(particles_of(model.scene(scene, 1.5))), static_cast<double>(particles_of(scene)),
              0.01 * static_cast<double>(particles_of(scene)));
}

TEST(CoarseModel, AScenesShareIsTheLeastOfItsLaws) {
  Scene scene = mpm::scene_with("taichi_water");
  CoarseModel model;
  model.particle_share = {{MaterialModel::water, 1.5}, {MaterialModel::jelly, 0.5}};
  EXPECT_EQ(model.share(scene, 2), 1.5);
  scene.materials["taichi_jelly"] = mpm::preset("taichi_jelly");
  EXPECT_EQ(model.share(scene, 2), 1.5);  // nothing is made of it
  scene.sources.push_back(scene.sources[0]);
  scene.sources.back().material = "taichi_jelly";
  EXPECT_EQ(model.share(scene, 2), 0.5);
  EXPECT_EQ(model.share(scene, 1), 1);
}

TEST(CoarseModel, SlowWavesTakeTheSubstepsOfTheSlowestThatCount) {
  Scene scene = mpm::scene_with("taichi_jelly");
  CoarseModel model;
  model.log_courant.least_speed[MaterialModel::jelly] = 40;
  const auto substeps = [&](double stiffness) {
    scene.materials.begin()->second.youngs_modulus = stiffness;
    return model.wave_substeps(scene);
  };
  EXPECT_EQ(substeps(1e3), substeps(1e4));
  EXPECT_NEAR(static_cast<double>(substeps(1e3)),
              std::exp(model.log_safety.at(MaterialModel::jelly) - model.log_courant.waves.at(MaterialModel::jelly)) *
                  40 * scene.frame_time / scene.domain.dx,
              1);
  EXPECT_GT(substeps(1e8), 2 * substeps(1e4));
}

TEST(CoarseModel, MaterialsThatNothingIsMadeOfSetNoStep) {
  Scene scene = mpm::scene_with("taichi_water");
  const CoarseModel model;
  const int64_t alone = model.wave_substeps(scene), largest = model.largest_step_substeps(scene);
  scene.materials["stiff"] = mpm::preset("taichi_jelly");
  scene.materials["stiff"].youngs_modulus = 1e8;
  EXPECT_EQ(model.wave_substeps(scene), alone);
  EXPECT_EQ(model.largest_step_substeps(scene), largest);
  scene.sources.push_back(scene.sources[0]);
  scene.sources.back().material = "stiff";
  EXPECT_GT(model.wave_substeps(scene), 2 * alone);
}

TEST(CoarseModel, WaterAloneKeepsItsFinestSpacing) {
  Scene scene = mpm::scene_with("taichi_water");
  scene.gravity = {0, 0, 0};
  CoarseModel soft = with("water.bulk_modulus.offset", -std::log(100));
  EXPECT_LT(soft.resolution(scene, Device::cpu), 1.5);
  soft.finest[MaterialModel::water] = 1.7;
  EXPECT_EQ(soft.resolution(scene, Device::cpu), 1.75);
  scene.materials["foam"] = mpm::preset("foam");  // a law without a finest spacing
  scene.materials["foam"].youngs_modulus = 1;
  EXPECT_EQ(soft.resolution(scene, Device::cpu), 1.75);
  scene.sources.push_back(scene.sources[0]);
  scene.sources.back().material = "foam";
  EXPECT_LT(soft.resolution(scene, Device::cpu), 1.75);
}

TEST(CoarseModel, FastMotionShortensTheStep) {
  const auto substeps_at = [](double speed) {
    Scene scene = mpm::scene_with("taichi_jelly");
    scene.frame_time = 1e-3;
    scene.sources[0].velocity = {0, -speed, 0};
    const auto run = mpm::Simulation::create(CoarseModel().scene(scene, 2.0), {});
    run->advance_frame();
    return run->statistics().substeps;
  };
  EXPECT_GT(substeps_at(100), 2 * substeps_at(1));
}

TEST(CoarseModel, EachLawHasItsSafetyFactor) {
  const auto substeps = [](const char* preset, double safety) {
    CoarseModel model;
    for (auto& [law, factor] : model.log_safety) factor = 0;
    model.log_safety[MaterialModel::snow] = safety;
    return model.wave_substeps(mpm::scene_with(preset));
  };
  EXPECT_NEAR(static_cast<double>(substeps("taichi_snow", std::log(3.0))),
              3 * static_cast<double>(substeps("taichi_snow", 0)), 3);
  EXPECT_EQ(substeps("taichi_jelly", std::log(3.0)), substeps("taichi_jelly", 0));
}

/// So that training on other recipes begins with them.
TEST(CoarseModel, RulesAreThoseOfTheShippedFile) {
  const nn::Weights shipped = nn::read_safetensors(GRAUPEL_SOURCE_DIR "/models/coarse-mpm.safetensors"),
                    own = CoarseModel().store();
  for (const char* rule : {"log_safety", "least_wave_speeds", "particle_shares", "finest_spacings"})
    EXPECT_EQ(own.get(rule, {4}), shipped.get(rule, {4})) << rule;
}

TEST(CoarseModel, ScriptedBodiesStayWithinACellASubstep) {
  Scene scene = mpm::scene_with("taichi_jelly");
  Obstacle paddle;
  paddle.shape = Shape::box;
  paddle.position = {0.2, 0.2, 0.2};
  paddle.motion = Motion();
  paddle.motion->velocity = {400, 0, 0};
  paddle.motion->spin = 30;
  scene.obstacles.push_back(paddle);
  const Scene coarse = CoarseModel().scene(scene, 2.0);
  EXPECT_NO_THROW(mpm::Simulation::create(coarse, {}));  // which refuses steps that are too long
}

TEST(CoarseModel, ZeroAndWhatIsBeyondTheLimitsStay) {
  MaterialConfig sand = mpm::preset("taichi_sand");
  sand.friction_angle = 0;
  sand.youngs_modulus = 5e9;
  const MaterialConfig same = with("sand.youngs_modulus.offset", 1e-9).constants.material(sand);
  EXPECT_EQ(same.friction_angle, 0);
  EXPECT_NEAR(same.youngs_modulus, 5e9, 100);
  EXPECT_EQ(with("sand.friction_angle.offset", 0.3).constants.material(sand).friction_angle, 0);
}

TEST(CoarseModel, AFileGivesTheSameModel) {
  CoarseModel model = with("snow.hardening.slope", 0.25);
  model.resolutions = {1, 1.5};
  model.log_courant.speed = -0.5;
  model.log_safety[MaterialModel::sand] = -0.25;
  model.log_courant.least_speed[MaterialModel::snow] = 26;
  model.particle_share[MaterialModel::sand] = 0.5;
  model.finest[MaterialModel::water] = 1.875;
  model.log_opponent[MaterialModel::sand] = -0.25;
  model.frame_cost = {{Device::cpu, {3.5, 0.5, 2.5}}, {Device::cuda, {1, 0.25, 0.75}}};
  model.metadata["recipe"] = "general";
  model.trained.widen(mpm::four_materials());
  const CoarseModel again = CoarseModel::load(model.store());
  EXPECT_EQ(again.resolutions, model.resolutions);
  EXPECT_EQ(again.log_courant.speed, -0.5);
  EXPECT_EQ(again.log_safety.at(MaterialModel::sand), -0.25);
  EXPECT_EQ(again.log_courant.least_speed.at(MaterialModel::snow), 26);
  EXPECT_EQ(again.particle_share.at(MaterialModel::sand), 0.5);
  EXPECT_EQ(again.particle_share.at(MaterialModel::water), 1);
  EXPECT_EQ(again.finest.at(MaterialModel::water), 1.875);
  EXPECT_EQ(again.log_opponent.at(MaterialModel::sand), -0.25);
  for (const Device device : {Device::cpu, Device::cuda}) {
    const FrameCost &same = again.frame_cost.at(device), &cost = model.frame_cost.at(device);
    EXPECT_EQ(same.frame, cost.frame);
    EXPECT_EQ(same.share, cost.share);
    EXPECT_EQ(same.spacing, cost.spacing);
  }
  EXPECT_EQ(again.metadata.at("recipe"), "general");
  EXPECT_EQ(again.trained.ranges, model.trained.ranges);
  for (std::size_t i = 0; i < model.parameters().size(); ++i)
    EXPECT_NEAR(again.parameters()[i], model.parameters()[i], 1e-6) << CoarseModel::parameter_names()[i];
}

std::string refusal(const nn::Weights& weights) {
  try {
    CoarseModel::load(weights);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CoarseModel, DamagedFilesAreRefusedByName) {
  nn::Weights good = CoarseModel().store();
  good.file = "coarse.safetensors";
  EXPECT_EQ(refusal(good), "");
  nn::Weights other = good;
  other.metadata["architecture"] = "hgn";
  EXPECT_THAT(refusal(other), HasSubstr("'coarse.safetensors': it holds no coarse MPM model"));
  other = good;
  other.metadata.erase("training.ranges");
  EXPECT_THAT(refusal(other), HasSubstr("training.ranges or training.contacts are missing"));
  other = good;
  other.metadata["parameter_names"] = "[\"a\"]";
  EXPECT_THAT(refusal(other), HasSubstr("of another version"));
  other = good;
  other.metadata["parameter_names"] = "{";
  EXPECT_THAT(refusal(other), HasSubstr("no JSON"));
  CoarseModel far;
  far.resolutions = {1, 20};
  EXPECT_THAT(refusal(far.store()), HasSubstr("resolutions[1] is 20 (allowed 1 to 8)"));
  far.resolutions = {2, 1};
  EXPECT_THAT(refusal(far.store()), HasSubstr("not ascending"));
  far.resolutions = {};
  EXPECT_THAT(refusal(far.store()), HasSubstr("resolutions is missing or empty"));
  CoarseModel wrong;
  wrong.particle_share[MaterialModel::sand] = 20;
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("particle_shares[1] is 20 (allowed 0.125 to 8)"));
  wrong.particle_share.clear();
  wrong.finest[MaterialModel::water] = 0.5;
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("finest_spacings[0] is 0.5 (allowed 1 to 8)"));
  wrong.finest.clear();
  wrong.log_courant.least_speed[MaterialModel::snow] = -1;
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("least_wave_speeds[2] is -1 (allowed 0 to 10000)"));
  wrong.log_courant.least_speed.clear();
  wrong.log_opponent[MaterialModel::sand] = 7;
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("log_opponent[1] is 7 (allowed -6 to 6)"));
  wrong.log_opponent.clear();
  wrong.frame_cost[Device::cuda].frame = -1;
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("frame_costs[1] is -1 (allowed 0 to 100)"));
  wrong.frame_cost[Device::cuda] = {0, 0.25, 5};
  EXPECT_THAT(refusal(wrong.store()), HasSubstr("cost_exponents[3] is 5 (allowed 0 to 4)"));
  other = good;
  other.tensors.erase("particle_shares");
  EXPECT_THAT(refusal(other), HasSubstr("particle_shares"));
  other = good;  // a file of a former version
  other.tensors.erase("frame_costs");
  other.tensors["cost_exponents"] = nn::Tensor::from_float({2.25F, 0.75F}, {2});
  EXPECT_THAT(refusal(other), HasSubstr("frame_costs"));
  EXPECT_THAT(refusal(with("sand.cohesion.offset", 100).store()), HasSubstr("is 100 (allowed -12 to 12)"));
  other = good;
  other.tensors["parameters"] = nn::Tensor::from_float({1, 2}, {2});
  EXPECT_NE(refusal(other), "");
}

TEST(CoarseModel, ConstantsOutsideTheTrainingAreNamed) {
  Scene scene = mpm::scene_with("taichi_sand");
  CoarseModel model;
  EXPECT_THAT(model.unlike_training(scene), ElementsAre());  // ranges that are not told
  model.trained.widen(scene);
  EXPECT_THAT(model.unlike_training(scene), ElementsAre());
  scene.materials["taichi_sand"].friction_angle = 50;
  scene.domain.wall_friction = 0.9;
  EXPECT_THAT(model.unlike_training(scene),
              ElementsAre(HasSubstr("sand.friction_angle is 50, of the training 45 to 45"),
                          HasSubstr("contact.friction is 0.9, of the training 0 to 0")));
  scene.domain.wall_friction = 0;
  scene.materials["taichi_sand"].friction_angle = 45;
  Obstacle sticky;
  sticky.contact = Contact::stick;
  scene.obstacles.push_back(sticky);
  EXPECT_THAT(model.unlike_training(scene), ElementsAre(HasSubstr("contact is stick, of the training")));
  EXPECT_THAT(model.unlike_training(mpm::scene_with("taichi_jelly")),
              ::testing::Contains(HasSubstr("jelly.youngs_modulus is")));
}

}  // namespace
}  // namespace graupel::hybrid
