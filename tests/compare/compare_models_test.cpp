// graupel compare with models of all kinds: networks and their parts, coarse and reduced models.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "compare/break_even.h"
#include "compare/comparison_files.h"
#include "compare/report/report.h"
#include "core/parallel/hardware.h"
#include "core/system/error.h"
#include "experiments/models/model_choice.h"
#include "graph/learned_simulator.h"
#include "hybrid/coarse_model.h"
#include "io/scene/scene_reader.h"
#include "nn/offline_cost.h"
#include "tests/apps/falling_model.h"
#include "tests/compare/small_comparison.h"

namespace graupel::experiments {
namespace {

using compare::MetricGroup;
using compare::ModelResult;

TEST_F(CompareRuns, OneStepOnlyNeedsNoRollouts) {
  CompareOptions o = options({"mpm", ballistic_network()});
  o.one_step_only = true;
  o.frames = 8;
  const auto comparison = make_comparison(o);
  EXPECT_EQ(comparison.groups, std::vector<MetricGroup>{MetricGroup::one_step});
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  const ModelResult& network = comparison.scenes[0].models[1];
  EXPECT_FALSE(network.values.contains("position_mse_all"));
  EXPECT_GT(network.values.at("one_step_mse"), 0);
  EXPECT_NE(compare::report_html(comparison).find("one_step"), std::string::npos);
  o.models = {"mpm:fast"};
  EXPECT_THROW(make_comparison(o), ConfigError);
}

TEST_F(CompareRuns, NetworksAndCorrectionsRunApart) {
  const std::string network = ballistic_network();
  CompareOptions o = options({"corrections-only", network, network + ":no-corrections", network + ":corrections-only"});
  o.frames = 20;  // onto the sphere
  o.floors = false;
  const auto comparison = make_comparison(o);
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  const auto& models = comparison.scenes[0].models;
  ASSERT_EQ(models.size(), 4u);
  const auto value = [&](std::size_t m, const char* key) { return models[m].values.at(key); };
  // Silenced, the network is gravity alone.
  EXPECT_EQ(value(0, "position_mse_all"), value(3, "position_mse_all"));
  EXPECT_NEAR(value(0, "position_mse_all"), value(1, "position_mse_all"), 1e-4 * value(1, "position_mse_all"));
  EXPECT_NEAR(value(0, "one_step_mse"), value(0, "one_step_mse_ballistic"), 1e-5 * value(0, "one_step_mse"));
  EXPECT_EQ(value(0, "network_ms"), 0);
  EXPECT_GT(value(0, "frame_ms"), 0);
  EXPECT_EQ(models[0].one_step_source, "true history");
  // Without corrections it falls into the sphere.
  EXPECT_LT(value(0, "inside_share"), 1e-3);
  EXPECT_GT(value(2, "inside_share"), 0.05);
  EXPECT_EQ(value(2, "projection_ms") < value(2, "frame_ms"), true);
}

TEST_F(CompareRuns, TheOfflineCostOfWeightsIsHeldAgainstTheirRuns) {
  const std::string silent = ballistic_network(), telling = folder_ + "/telling.safetensors";
  nn::Weights weights = nn::read_safetensors(silent);
  weights.metadata[nn::offline_cost_key] =
      R"({"data": [{"seconds": 2, "device": "a"}, {"seconds": 3, "device": ""}], "training": [{"seconds": 7, "device": "a"}]})";
  nn::write_safetensors(telling, weights);
  CompareOptions o = options({"mpm", telling, silent, telling + ":corrections-only"});
  o.frames = 5;
  o.floors = false;
  const compare::Comparison comparison = make_comparison(o);
  EXPECT_EQ(comparison.hardware, hardware_name(Device::cpu, 1));
  ASSERT_EQ(comparison.offline.size(), 2u);
  EXPECT_EQ(comparison.offline.at(telling).data, 5);
  EXPECT_EQ(comparison.offline.at(telling).training, 7);
  EXPECT_EQ(comparison.offline.at(telling).devices, (std::vector<std::string>{"a", "hardware that is not told"}));
  EXPECT_FALSE(comparison.offline.at(silent).data || comparison.offline.at(silent).training);
  const compare::SceneResult& scene = comparison.scenes.front();
  EXPECT_DOUBLE_EQ(scene.mpm_frame_ms, scene.models[0].values.at("frame_ms"));
  EXPECT_GT(scene.opponent_frame_ms, 0);
  const std::vector<compare::BreakEven> results = compare::break_evens(comparison);
  ASSERT_EQ(results.size(), 2u);
  EXPECT_DOUBLE_EQ(results[0].scene_seconds, 5e-3 * scene.models[1].values.at("frame_ms"));
  EXPECT_DOUBLE_EQ(results[0].rivals[1].rival_seconds, 5e-3 * scene.mpm_frame_ms);
  EXPECT_TRUE(results[0].estimate);
}

TEST_F(CompareRuns, TheFileOfANetworkIsReadOnceForAllItsParts) {
  const std::vector<ModelChoice> whole = {parse_model(ballistic_network())};
  std::filesystem::remove(whole[0].weights);
  const ModelChoice part = parse_model(whole[0].weights + ":no-corrections", whole);
  EXPECT_EQ(part.contents, whole[0].contents);
  EXPECT_EQ(graph::LearnedSimulator(part.contents).weights().file, whole[0].weights);
}

TEST_F(CompareRuns, PartsOfNetworksNeedANetwork) {
  EXPECT_THAT(
      [&] {
        make_comparison(options({"corrections-only", "mpm"}));
      },
      ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("WEIGHTS:corrections-only")));
  EXPECT_THROW(make_comparison(options({"missing.safetensors:no-corrections"})), InputError);
  const std::string model = folder_ + "/falling.safetensors";
  std::ofstream(folder_ + "/falling.json") << test::falling_scene();
  nn::write_safetensors(model, test::falling_model(io::read_scene(folder_ + "/falling.json")).store(nn::DType::f32));
  EXPECT_THAT([&] { make_comparison(options({model + ":no-corrections"})); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("that has no corrections")));
}

TEST_F(CompareRuns, AModelThatIsPulledStandsBesideItselfWithout) {
  const std::string file = folder_ + "/pulled.safetensors", json = folder_ + "/falling.json";
  std::ofstream(json) << test::falling_scene();
  rom::ReducedModel model = test::falling_model(io::read_scene(json));
  model.manifold_pull = 0.2;
  nn::write_safetensors(file, model.store(nn::DType::f32));
  CompareOptions o = options({file});
  o.scenes = {json};
  o.frames = 3;
  o.floors = false;
  const std::string free = file + ":no-pull";
  for (const auto& models : {std::vector<std::string>{file}, std::vector<std::string>{free, file}}) {
    o.models = models;
    const auto comparison = make_comparison(o);
    std::map<std::string, double> pull;
    for (const ModelResult& result : comparison.scenes[0].models)
      if (result.role == compare::ModelRole::reduced) {
        pull[result.model] = result.manifold_pull;
        EXPECT_EQ(result.trust->verdict, "unknown");  // no calibration runs
      }
    EXPECT_EQ(pull, (std::map<std::string, double>{{file, 0.2}, {free, 0.0}}));
    EXPECT_THAT(compare::comparison_table(comparison), ::testing::HasSubstr("pull 0.2"));
    EXPECT_THAT(compare::comparison_table(comparison), ::testing::HasSubstr("manifold_pull"));
  }
  EXPECT_THAT([&] { make_comparison(options({ballistic_network() + ":no-pull"})); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("without its pull")));
}

TEST_F(CompareRuns, ADivergedNetworkIsHeldAndMarked) {
  // 0.6 m a frame^2: over a domain edge a frame from the second frame on
  const std::string path = constant_network("wild", {0.6f, 0, 0});
  CompareOptions o = options({path});
  o.floors = false;
  const auto comparison = make_comparison(o);
  const ModelResult& wild = comparison.scenes[0].models[0];
  EXPECT_GE(wild.diverged_at_frame, 1);
  EXPECT_LE(wild.diverged_at_frame, 5);
  EXPECT_EQ(wild.curves.position.size(), 10u);  // the missing frames count
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
}

TEST_F(CompareRuns, CoarseModelsRunAndSayWhatTheyDoNotKnow) {
  hybrid::CoarseModel model;
  Scene trained;
  trained.materials["sand"] = *material_preset("sand");
  model.trained.widen(trained);
  const std::string file = folder_ + "/coarse.safetensors";
  nn::write_safetensors(file, model.store());
  std::ofstream(folder_ + "/stream.json") << scene_with("stream", stream);
  CompareOptions o = options({file, "mpm:coarse:fast"});
  o.scenes.push_back(folder_ + "/stream.json");
  for (const compare::SceneResult& scene : make_comparison(o).scenes) {
    const ModelResult& result = scene.models[0];
    EXPECT_EQ(result.diverged_at_frame, -1) << scene.name;
    EXPECT_LT(result.values.at("position_mse_all"), 0.05) << scene.name;
    EXPECT_GT(result.values.at("position_mse_all"), 0) << scene.name;
    EXPECT_LT(result.values.at("ratio_density_error"), 10) << scene.name;
    EXPECT_GE(result.values.at("substeps_per_frame"), 1) << scene.name;
    EXPECT_THAT(result.remarks, ::testing::Contains(::testing::HasSubstr("outside the training: water.")));
  }
  o.one_step_only = true;
  EXPECT_THAT([&] { make_comparison(o); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("has no one-step error without a rollout")));
}

TEST_F(CompareRuns, AReducedModelRunsOnItsOwnSceneOnly) {
  const std::string falling = folder_ + "/falling.json", model = folder_ + "/falling.safetensors";
  std::ofstream(falling) << test::falling_scene();
  nn::write_safetensors(model, test::falling_model(io::read_scene(falling)).store(nn::DType::f32));
  CompareOptions o = options({"mpm", model});
  o.scenes.push_back(falling);
  o.frames = 2;
  o.floors = false;
  EXPECT_THROW(make_comparison(o), ConfigError);
  o.other_scenes = OtherScenes::leave_out;
  const compare::Comparison comparison = make_comparison(o);
  ASSERT_EQ(comparison.scenes.size(), 2u);
  EXPECT_EQ(comparison.scenes[0].models.size(), 1u);
  ASSERT_EQ(comparison.scenes[1].models.size(), 3u);
  EXPECT_EQ(comparison.scenes[1].models[1].model, model);
  EXPECT_EQ(comparison.scenes[1].models[2].model, "nothing-moves");
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  EXPECT_THAT(compare::report_html(comparison), ::testing::HasSubstr("1 of 2 scenes"));
}

}  // namespace
}  // namespace graupel::experiments
