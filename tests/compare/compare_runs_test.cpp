// graupel compare from scenes to files: every key finite, known answers for MPM and for a network that only falls.
#include "experiments/comparison/compare_runs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/verbs.h"
#include "compare/break_even.h"
#include "compare/report/report.h"
#include "core/parallel/hardware.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/comparison/scene_tasks.h"
#include "experiments/models/memory_meter.h"
#include "experiments/models/model_choice.h"
#include "experiments/models/mpm_run.h"
#include "experiments/models/network_run.h"
#include "experiments/models/start_state.h"
#include "hybrid/coarse_model.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/sampling.h"
#include "nn/offline_cost.h"
#include "nn/weights.h"
#include "tests/apps/falling_model.h"
#include "tests/graph/random_weights.h"

namespace graupel::experiments {
namespace {

using compare::MetricGroup;
using compare::ModelResult;

/// Some 200 particles of water and sand that fall on a sphere.
constexpr const char* small_scene = R"({
  "name": "small",
  "seed": 3,
  "domain": { "size": [1, 1, 1], "dx": 0.03125 },
  "materials": { "water": { "preset": "water", "bulk_modulus": 1e4 }, "sand": { "preset": "sand", "youngs_modulus": 1e5 } },
  "sources": [
    { "shape": "box", "size": [0.09, 0.09, 0.09], "position": [0.5, 0.5, 0.5], "material": "water", "velocity": [0, -1, 0] },
    { "shape": "box", "size": [0.09, 0.09, 0.09], "position": [0.3, 0.7, 0.6], "material": "sand" }
  ],
  "obstacles": [ { "shape": "sphere", "radius": 0.15, "position": [0.5, 0.26, 0.5] } ],
  "frames": 10
})";

class CompareRuns : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "graupel_compare_XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    scene_ = folder_ + "/small.json";
    std::ofstream(scene_) << small_scene;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  CompareOptions options(const std::vector<std::string>& models) const {
    CompareOptions o;
    o.scenes = {scene_};
    o.models = models;
    o.threads = 1;
    return o;
  }

  /// A network whose acceleration is g dt^2 whatever it sees.
  std::string ballistic_network() const {
    graph::HgnConfig config;
    config.latent = 8;
    config.levels = 2;
    config.message_passing = 1;
    config.dx = 0.03125;
    graph::Normalization normalization;
    normalization.acceleration_mean[1] = static_cast<float>(-9.8 / 3600);
    auto weights = graph::random_weights(config, normalization);
    graph::silence_decoder(weights);
    const std::string path = folder_ + "/ballistic.safetensors";
    nn::write_safetensors(path, weights);
    return path;
  }

  std::string folder_, scene_;
};

TEST_F(CompareRuns, FloorsOfAFileAreThoseThatWereMeasured) {
  CompareOptions measure = options({"mpm:fast"});
  measure.write_floors = folder_ + "/floors.json";
  measure.json = folder_ + "/measured.json";
  ::testing::internal::CaptureStdout();
  run_compare(measure);
  CompareOptions read = options({"mpm:fast"});
  read.floor_file = measure.write_floors;
  read.json = folder_ + "/read.json";
  run_compare(read);
  ::testing::internal::GetCapturedStdout();
  const auto measured = nlohmann::json::parse(read_file(measure.json)),
             known = nlohmann::json::parse(read_file(read.json));
  EXPECT_GT(known["results"][0]["floor_sinkhorn"], 0);
  for (const auto& [key, value] : measured["results"][0].items())
    if (key.starts_with("floor_") || key == "against_opponent") {
      EXPECT_EQ(known["results"][0][key], value) << key;
    }
  EXPECT_EQ(known["scenes"][0]["floor_curves"], measured["scenes"][0]["floor_curves"]);

  const auto refusal = [](CompareOptions o) -> std::string {
    try {
      make_comparison(o);
    } catch (const InputError& error) {
      return error.what();
    }
    return "not refused";
  };
  CompareOptions other = read;
  other.set = {"materials.sand.youngs_modulus=2e5"};
  EXPECT_THAT(refusal(other), ::testing::HasSubstr("are stale"));
  other = read;
  other.seed = 4;
  EXPECT_THAT(refusal(other), ::testing::HasSubstr("are stale"));
  other = read;
  other.frames = 5;
  EXPECT_THAT(refusal(other),
              ::testing::AllOf(::testing::HasSubstr("of 10 frames, not of 5"), ::testing::HasSubstr("--frames 10")));
  other = read;
  other.floor_file = scene_;
  EXPECT_THAT(refusal(other), ::testing::HasSubstr("is no file of chaos floors"));
  std::string text = read_file(read.floor_file);
  text.replace(text.find("small"), 5, "other");
  std::ofstream(read.floor_file) << text;
  EXPECT_THAT(refusal(read), ::testing::HasSubstr("holds no chaos floors of scene 'small'"));
}

TEST_F(CompareRuns, EverySceneAndModelHoldsEveryKey) {
  CompareOptions o = options({"mpm", "mpm:fast", "mpm:coarse:fast", ballistic_network()});
  o.json = folder_ + "/out.json";
  o.csv = folder_ + "/out.csv";
  o.report = folder_ + "/report.html";
  o.command = "graupel compare ...";
  ::testing::internal::CaptureStdout();
  run_compare(o);
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), ::testing::HasSubstr("ballistic.safetensors"));

  const auto json = nlohmann::json::parse(read_file(o.json));
  ASSERT_EQ(json["results"].size(), 4u);
  for (const auto& entry : json["results"]) {
    EXPECT_FALSE(entry.contains("diverged_at_frame")) << entry["model"];
    const bool one_step = entry["one_step_source"] != "none";
    EXPECT_EQ(one_step, entry["model"].get<std::string>().ends_with(".safetensors"));
    for (const compare::MetricInfo& metric : compare::metric_list()) {
      if (metric.group == MetricGroup::one_step && !one_step) {
        EXPECT_FALSE(entry.contains(metric.key)) << metric.key;
        continue;
      }
      ASSERT_TRUE(entry.contains(metric.key) && entry[metric.key].is_number()) << metric.key;
      EXPECT_TRUE(std::isfinite(entry[metric.key].get<double>())) << metric.key;
    }
    EXPECT_EQ(entry["materials"].size(), 2u);
    EXPECT_EQ(entry["curves"]["position_error"].size(), 10u);
    EXPECT_GT(entry["peak_memory_mib"], 1);
    EXPECT_GT(entry["frame_ms"], 0);
  }
  const auto& mpm = json["results"][0];
  for (const char* key : {"position_mse_all", "sinkhorn", "density_error", "loses_to_coarse"})
    EXPECT_EQ(mpm[key], 0) << key;
  EXPECT_EQ(mpm["speed_ratio"], 1);
  EXPECT_GT(mpm["floor_position_mse_all"], 0);
  EXPECT_LT(mpm["floor_position_mse_20"], 1e-4);
  EXPECT_LT(json["results"][2]["particles"].get<double>(), mpm["particles"].get<double>() / 6);

  const auto& fast = json["results"][1];  // the largest stable step: fewer substeps, so another run
  EXPECT_LT(fast["substeps_per_frame"], mpm["substeps_per_frame"]);
  EXPECT_GT(fast["step_search_s"], 0);
  EXPECT_GT(fast["position_mse_all"], 0);
  EXPECT_EQ(mpm["step_search_s"], 0);

  const auto& coarse = json["results"][2];  // the opponent: held against nothing
  EXPECT_EQ(json["scenes"][0]["opponent"], "mpm:coarse:fast");
  EXPECT_FALSE(coarse.contains("against_opponent"));
  EXPECT_TRUE(fast.contains("against_opponent"));
  EXPECT_EQ(coarse["loses_to_coarse"], 0);
  EXPECT_GT(coarse["step_search_s"], 0);
  EXPECT_LT(coarse["substeps_per_frame"], mpm["substeps_per_frame"].get<double>() / 2);
  EXPECT_EQ(json["geometric_mean"].size(), 4u);

  const auto& falling = json["results"][3];
  EXPECT_EQ(falling["substeps_per_frame"], 1);
  EXPECT_EQ(falling["one_step_source"], "true history");
  EXPECT_NEAR(falling["one_step_mse"], falling["one_step_mse_ballistic"],
              1e-3 * falling["one_step_mse_ballistic"].get<double>());
  EXPECT_GT(falling["position_mse_all"], falling["floor_position_mse_all"]);
  EXPECT_GT(falling["network_ms"], 0);
  EXPECT_GT(falling["grid_build_ms"], 0);
  EXPECT_LT(std::filesystem::file_size(o.report), compare::largest_report);
  EXPECT_GT(std::filesystem::file_size(o.csv), 500u);
}

TEST_F(CompareRuns, AStoredTrajectoryIsTheTruth) {
  const Scene scene = io::read_scene(scene_);
  MpmRunOptions run;
  run.seed = 3;
  run.frames = 6;
  Trajectory truth = run_mpm(scene, run).run.trajectory;
  truth.scene_json = scene.source;
  truth.frames[0].velocity = start_of(scene, 3).velocity;
  for (std::size_t f = 1; f < truth.frames.size(); ++f) truth.frames[f].velocity.resize(truth.particle_count());
  CompareOptions o = options({"mpm"});
  o.scenes = {folder_ + "/truth.h5"};
  o.frames = 5;
  o.floors = false;
  io::TrajectoryWriter writer(o.scenes[0], truth);
  for (const ParticleFrame& frame : truth.frames) writer.append(frame);
  writer.finish();

  const auto comparison = make_comparison(o);
  ASSERT_EQ(comparison.scenes.size(), 1u);
  const ModelResult& mpm = comparison.scenes[0].models[0];
  EXPECT_EQ(comparison.scenes[0].frames, 5u);
  EXPECT_EQ(mpm.values.at("position_mse_all"), 0);  // the same run again on the same machine
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  EXPECT_FALSE(mpm.values.contains("floor_sinkhorn"));
  o.frames = 500;
  EXPECT_THAT([&] { make_comparison(o); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("500 is more than")));
  o.frames = 5;
  o.set = {"frames=3"};
  EXPECT_THROW(make_comparison(o), ConfigError);
}

TEST_F(CompareRuns, ADivergingTruthIsNamedAndTheScenesBeforeItAreWritten) {
  std::string stiff = small_scene;
  stiff.replace(stiff.find("\"small\""), 7, "\"stiff\"");
  stiff.insert(stiff.find("\"seed\""), R"("time_step": { "policy": "fixed", "substeps_per_frame": 1 }, )");
  CompareOptions o = options({"mpm"});
  o.scenes.push_back(folder_ + "/other.json");
  std::ofstream(o.scenes[1]) << stiff;
  o.floors = false;
  o.json = folder_ + "/out.json";
  ::testing::internal::CaptureStdout();
  EXPECT_THAT([&] { run_compare(o); }, ::testing::ThrowsMessage<DivergedError>(::testing::AllOf(
                                           ::testing::HasSubstr("scene 'stiff'"), ::testing::HasSubstr("other.json"))));
  ::testing::internal::GetCapturedStdout();
  const auto json = nlohmann::json::parse(read_file(o.json));
  ASSERT_EQ(json["results"].size(), 1u);
  EXPECT_EQ(json["results"][0]["scene"], "small");
}

TEST_F(CompareRuns, RefusesTwoScenesOfOneName) {
  CompareOptions o = options({"mpm"});
  o.scenes.push_back(folder_ + "/twin.json");
  std::ofstream(o.scenes[1]) << small_scene;
  EXPECT_THAT([&] { make_comparison(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::AllOf(
                                               ::testing::HasSubstr("small.json"), ::testing::HasSubstr("twin.json"))));
}

TEST_F(CompareRuns, RefusesCudaWhereItCannotBe) {
  CompareOptions o = options({"mpm", ballistic_network()});
  o.device = "cuda";  // without a GPU; with one, since the network is not wide enough
  EXPECT_THAT([&] { make_comparison(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("--device cpu")));
}

TEST_F(CompareRuns, FindsUnwritableOutputsBeforeTheWork) {
  CompareOptions o = options({"missing.safetensors"});  // would be an InputError once the work begins
  for (std::string CompareOptions::*target : {&CompareOptions::json, &CompareOptions::csv, &CompareOptions::report}) {
    CompareOptions bad = o;
    bad.*target = folder_ + "/none/out";
    EXPECT_THROW(run_compare(bad), IoError);
    bad.*target = folder_;
    EXPECT_THROW(run_compare(bad), IoError);
  }
  o.pictures = scene_;  // a file
  EXPECT_THROW(run_compare(o), IoError);
}

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

TEST_F(CompareRuns, ADivergedNetworkIsHeldAndMarked) {
  graph::HgnConfig config;
  config.latent = 8;
  config.levels = 2;
  config.message_passing = 1;
  config.dx = 0.03125;
  graph::Normalization normalization;
  normalization.acceleration_mean[0] = 0.6f;  // 0.6 m a frame^2: over a domain edge a frame from the second frame on
  auto weights = graph::random_weights(config, normalization);
  graph::silence_decoder(weights);
  const std::string path = folder_ + "/wild.safetensors";
  nn::write_safetensors(path, weights);
  CompareOptions o = options({path});
  o.floors = false;
  const auto comparison = make_comparison(o);
  const ModelResult& wild = comparison.scenes[0].models[0];
  EXPECT_GE(wild.diverged_at_frame, 1);
  EXPECT_LE(wild.diverged_at_frame, 5);
  EXPECT_EQ(wild.curves.position.size(), 10u);  // the missing frames count
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
}

TEST_F(CompareRuns, RefusesWhatItCannotCompare) {
  EXPECT_THROW(make_comparison(options({})), ConfigError);
  for (const char* word : {"mpm:slow", "mpm:", "mpm:fine:fast", "mpm:fast:coarse"})
    EXPECT_THAT([&] { make_comparison(options({word})); },
                ::testing::ThrowsMessage<ConfigError>(
                    ::testing::AllOf(::testing::HasSubstr(word), ::testing::HasSubstr("mpm:coarse:fast, mpm:fine"))));
  EXPECT_THROW(make_comparison(options({"mpm", "mpm"})), ConfigError);
  EXPECT_THROW(make_comparison(options({"missing.safetensors"})), InputError);
  CompareOptions o = options({"mpm"});
  o.scenes = {};
  EXPECT_THROW(make_comparison(o), ConfigError);
  std::filesystem::create_directory(folder_ + "/empty");
  o.scenes = {folder_ + "/empty"};
  EXPECT_THROW(make_comparison(o), ConfigError);
  o.scenes = {folder_ + "/missing.h5"};
  EXPECT_THROW(make_comparison(o), InputError);
}

MpmRunOptions seeded(int64_t frames) {
  MpmRunOptions options;
  options.seed = 3;
  options.frames = frames;
  return options;
}

/// The small scene with more in it: `extra` are members of the scene, `domain` of its domain.
std::string scene_with(const std::string& name, const std::string& extra, const std::string& domain = "") {
  std::string text = small_scene;
  text.replace(text.find("\"small\""), 7, "\"" + name + "\"");
  text.insert(text.find("\"seed\""), extra);
  if (!domain.empty()) text.insert(text.find("\"dx\""), domain);
  return text;
}

constexpr const char* stream = R"("emitters": [ { "shape": "box", "size": [0.1, 0.04, 0.1], "position": [0.7, 0.8, 0.4],
  "material": "water", "velocity": [0, -2, 0], "start_time": 0.02, "end_time": 0.12 } ],
  "sinks": [ { "shape": "half_space", "normal": [0, 1, 0], "position": [0, 0.5, 0] } ], )";

TEST_F(CompareRuns, RunsScenesOfAllKinds) {
  std::string moving = scene_with("moving", "");
  moving.replace(moving.find("\"radius\""), 0, R"("motion": { "velocity": [0.5, 0, 0] }, )");
  const std::string periodic = R"({"x_low": {"kind": "periodic"}, "x_high": {"kind": "periodic"}})";
  const std::pair<const char*, std::string> scenes[] = {
      {"stream", scene_with("stream", stream)},
      {"moving", moving},
      {"periodic", scene_with("periodic", "", "\"wall_cells\": 2, \"faces\": " + periodic + ", ")},
      {"open", scene_with("open", "", R"("faces": {"y_low": {"kind": "open"}}, )")},
      {"plane", scene_with("plane", "", "\"dimensions\": 2, ")}};
  CompareOptions o = options({"mpm", "mpm:fast", "mpm:coarse", "mpm:coarse:fast", "mpm:fine"});
  o.scenes.clear();
  for (const auto& [name, text] : scenes) {
    o.scenes.push_back(folder_ + "/" + name + ".json");
    std::string content = text;
    if (std::string(name) == "plane")  // bodies that reach the plane, half way along z
      content.replace(content.find("0.7, 0.6]"), 9, "0.7, 0.5]");
    std::ofstream(o.scenes.back()) << content;
  }
  o.report = folder_ + "/report.html";
  const compare::Comparison comparison = make_comparison(o);
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  ASSERT_EQ(comparison.scenes.size(), std::size(scenes));
  for (const compare::SceneResult& scene : comparison.scenes) {
    SCOPED_TRACE(scene.name);
    ASSERT_EQ(scene.models.size(), 5u);
    for (const char* key : {"position_mse_all", "sinkhorn", "density_error", "kinetic_energy_error"})
      EXPECT_EQ(scene.models[0].values.at(key), 0) << key;
    for (const ModelResult& result : scene.models) {
      EXPECT_EQ(result.diverged_at_frame, -1) << result.model;
      EXPECT_LT(result.values.at("position_mse_all"), 0.05) << result.model;
      EXPECT_LT(result.values.at("density_error"), 1) << result.model;
    }
    EXPECT_GT(scene.models[1].values.at("floor_position_mse_all"), 0);
    EXPECT_LT(scene.models[1].values.at("floor_position_mse_all"), 1e-3);
    EXPECT_EQ(scene.models[3].values.at("ratio_sinkhorn"), 1);
    EXPECT_GT(scene.models[4].values.at("particles"), 3 * scene.models[0].values.at("particles"));
  }
  o.models = {ballistic_network()};
  EXPECT_THAT([&] { make_comparison(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr(
                                               "ballistic.safetensors' is for 3 dimensions and 'plane' has 2")));
  o.scenes.pop_back();
  for (const compare::SceneResult& scene : make_comparison(o).scenes) {
    EXPECT_EQ(scene.models[0].diverged_at_frame, -1) << scene.name;
    EXPECT_LT(scene.models[0].values.at("position_mse_20"), 0.05) << scene.name;
    EXPECT_GT(scene.models[0].values.at("position_mse_20"), 0) << scene.name;
  }
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

TEST_F(CompareRuns, AStoredStreamIsATruth) {
  std::ofstream(folder_ + "/stream.json") << scene_with("stream", stream);
  const Scene scene = io::read_scene(folder_ + "/stream.json");
  Trajectory truth = run_mpm(scene, seeded(8)).run.trajectory;
  truth.scene_json = scene.source;
  truth.seed = 3;
  StartState start = start_of(scene, 3);
  for (std::size_t i = 0; i < start.velocity.size(); ++i)
    if (start.birth_time[i] > 0) start.velocity[i] = {0, 0, 0};  // as in a file
  truth.frames[0].velocity = start.velocity;
  for (std::size_t f = 1; f < truth.frames.size(); ++f) truth.frames[f].velocity.resize(truth.particle_count());
  CompareOptions o = options({"mpm", "mpm:coarse"});
  o.scenes = {folder_ + "/truth.h5"};
  o.floors = false;
  io::TrajectoryWriter writer(o.scenes[0], truth, {.active = true});
  for (const ParticleFrame& frame : truth.frames) writer.append(frame);
  writer.finish();
  const auto comparison = make_comparison(o);
  EXPECT_EQ(comparison.scenes[0].models[0].values.at("position_mse_all"), 0);
  EXPECT_LT(comparison.scenes[0].models[1].values.at("position_mse_all"), 2e-4);  // born with the stream's velocity
}

TEST_F(CompareRuns, RecipesAndDataSetsHaveSplits) {
  const std::string recipe = std::string(GRAUPEL_SOURCE_DIR) + "/scenes/recipes/general.json";
  CompareOptions o = options({"mpm"});
  o.set = {"counts.test=9"};
  o.split = "test";
  o.scenes = {recipe, "2"};
  auto tasks = read_scene_tasks(o);
  ASSERT_EQ(tasks.size(), 2u);
  EXPECT_EQ(tasks[0].category, "dam_break");
  EXPECT_EQ(tasks[1].category, "column_collapse");
  EXPECT_EQ(tasks[1].source, recipe + "#1");
  EXPECT_EQ(tasks[0].frames, 240);
  const uint64_t seed = tasks[0].seed;
  o.seed = 7;
  EXPECT_NE(read_scene_tasks(o)[0].seed, seed);
  o.seed.reset();
  o.scenes = {recipe};
  EXPECT_EQ(read_scene_tasks(o).size(), 9u);

  const auto refusal = [&]() -> std::string {
    try {
      read_scene_tasks(o);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "not refused";
  };
  o.scenes = {recipe, "10"};
  EXPECT_THAT(refusal(), ::testing::AllOf(::testing::HasSubstr("10 is more than"), ::testing::HasSubstr("1 to 9")));
  o.scenes = {recipe, "0"};
  EXPECT_THAT(refusal(), ::testing::HasSubstr("at least 1"));
  o.scenes = {recipe};
  o.split = "tset";
  EXPECT_THAT(refusal(), ::testing::HasSubstr("--split 'tset' is unknown (allowed: train, valid, test)"));
  o.split = "";
  EXPECT_THAT(refusal(), ::testing::HasSubstr("Choose one with --split (allowed: train, valid, test)"));
  o.set = {};
  o.scenes = {scene_};
  o.split = "valid";
  EXPECT_THAT(refusal(), ::testing::HasSubstr("--split valid is for recipes"));
  o.split = "";
  o.scenes = {scene_, "3"};
  EXPECT_THAT(refusal(), ::testing::HasSubstr("--scenes 3 is a number of scenes"));

  std::filesystem::create_directory(folder_ + "/set");
  std::ofstream(folder_ + "/set/dataset.json") << "{}";
  o.scenes = {folder_ + "/set"};
  EXPECT_THAT(refusal(), ::testing::HasSubstr("has several splits"));
  const Scene scene = io::read_scene(scene_);
  Trajectory truth = run_mpm(scene, seeded(1)).run.trajectory;
  truth.scene_json = scene.source;
  io::TrajectoryWriter writer(folder_ + "/set/valid.h5", truth, {});
  for (ParticleFrame& frame : truth.frames) {
    frame.velocity.resize(truth.particle_count());
    writer.append(frame);
  }
  writer.finish();
  o.split = "valid";
  ASSERT_EQ(read_scene_tasks(o).size(), 1u);
  EXPECT_EQ(read_scene_tasks(o)[0].scene.name, "valid#0");
}

TEST_F(CompareRuns, TheStoredFloorsOfTheValidationSplitAreThoseOfItsScenes) {
  CompareOptions o = options({"mpm"});
  o.scenes = {std::string(GRAUPEL_SOURCE_DIR) + "/scenes/recipes/general.json"};
  o.split = "valid";
  o.frames = 120;
  const FloorFile floors(GRAUPEL_SOURCE_DIR "/scenes/floors/general_valid.json");
  const auto tasks = read_scene_tasks(o);
  EXPECT_EQ(tasks.size(), 16u);
  for (const SceneTask& task : tasks)
    EXPECT_GT(floors.of(task.scene, task.seed, task.frames).values.at("floor_density_error"), 0) << task.scene.name;
}

TEST_F(CompareRuns, MovedBirthsAreAllTheSameDistanceOff) {
  std::ofstream(folder_ + "/stream.json") << scene_with("stream", stream);
  const Scene scene = io::read_scene(folder_ + "/stream.json");
  const double distance = 1e-4 * scene.domain.dx;
  const auto before = mpm::sample_sources(scene, 3);
  auto after = before;
  move_births(scene, 3, distance, after);
  EXPECT_GT(after.birth_time.back(), 0);
  ASSERT_EQ(before.position.size(), after.position.size());
  for (std::size_t p = 0; p < before.position.size(); ++p)
    EXPECT_NEAR(norm(after.position[p] - before.position[p]), distance, 1e-9 * distance + 1e-15);
  Scene plane = scene;
  plane.domain.dimensions = 2;
  after = before;
  move_births(plane, 3, distance, after);
  for (std::size_t p = 0; p < before.position.size(); ++p) ASSERT_EQ(after.position[p][2], before.position[p][2]);
}

TEST(MemoryMeter, SeesWhatARunTouches) {
  const MemoryMeter meter;
  const std::vector<char> block(std::size_t(64) << 20, 1);
  EXPECT_GT(meter.peak(), double(block.size()));
  EXPECT_GT(meter.added(), 0.9 * double(block.size()));
}

TEST(CompareVerb, HelpIsShortAndHasTwoExamples) {
  const CommandLine program("graupel");
  apps::add_compare(program);
  const char* const words[] = {"graupel", "compare", "--help"};
  ::testing::internal::CaptureStdout();
  EXPECT_EQ(program.run(3, words, "graupel"), 0);
  const std::string help = ::testing::internal::GetCapturedStdout();
  EXPECT_LT(std::count(help.begin(), help.end(), '\n'), 40);
  for (const char* flag : {"--scenes", "--models", "--frames", "--set", "--json", "--csv", "--report", "--seed",
                           "--threads", "--device", "--one-step-only"})
    EXPECT_NE(help.find(flag), std::string::npos) << flag;
  EXPECT_NE(help.find("Examples:"), std::string::npos);
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
  ASSERT_EQ(comparison.scenes[1].models.size(), 2u);
  EXPECT_EQ(comparison.scenes[1].models[1].model, model);
  EXPECT_TRUE(compare::incomplete_results(comparison).empty());
  EXPECT_THAT(compare::report_html(comparison), ::testing::HasSubstr("1 of 2 scenes"));
}

}  // namespace
}  // namespace graupel::experiments
