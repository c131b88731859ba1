// graupel compare from scenes to files: every key finite, known answers for MPM, errors that come before the work.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/verbs.h"
#include "compare/report/report.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/models/memory_meter.h"
#include "tests/compare/small_comparison.h"

namespace graupel::experiments {
namespace {

using compare::MetricGroup;

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

TEST_F(CompareRuns, ForcesOfTheTruthAndOfCoarseRunsAreRecordedAndChangeNothing) {
  CompareOptions o = options({"mpm", "mpm:coarse", ballistic_network()});
  o.floors = false;
  const compare::Comparison without = make_comparison(o);
  o.forces = true;
  const compare::Comparison with = make_comparison(o);
  const compare::SceneResult& scene = with.scenes[0];
  EXPECT_EQ(scene.models[1].values.at("position_mse_all"), without.scenes[0].models[1].values.at("position_mse_all"));
  ASSERT_EQ(scene.true_forces.frames.size(), 11u);
  ASSERT_EQ(scene.models[1].forces.frames.size(), 11u);
  EXPECT_EQ(scene.models[1].forces.names, scene.true_forces.names);
  EXPECT_EQ(scene.true_forces.names.front(), "obstacle_0");
  const auto impulse = [](const compare::ContactForces& forces) {
    double sum = 0;
    for (const auto& frame : forces.frames) sum += norm(frame[0].impulse);
    return sum;
  };
  EXPECT_GT(impulse(scene.true_forces), 0);
  EXPECT_NEAR(impulse(scene.models[1].forces) / impulse(scene.true_forces), 1, 0.5);  // 8 times fewer particles
  EXPECT_TRUE(scene.models[2].forces.names.empty());
  EXPECT_TRUE(without.scenes[0].true_forces.names.empty());
  ASSERT_EQ(scene.rivals.size(), 2u);
  EXPECT_EQ(scene.rivals[0].name, "mpm:coarse");
  EXPECT_EQ(scene.rivals[1].name, "nothing-moves");
  EXPECT_NEAR(scene.rivals[1].values.at("displacement_relative_error"), 1, 1e-6);
}

TEST_F(CompareRuns, RefusesTwoScenesOfOneName) {
  CompareOptions o = options({"mpm"});
  o.scenes.push_back(folder_ + "/twin.json");
  std::ofstream(o.scenes[1]) << small_scene;
  EXPECT_THAT([&] { make_comparison(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::AllOf(
                                               ::testing::HasSubstr("small.json"), ::testing::HasSubstr("twin.json"))));
}

TEST_F(CompareRuns, PicturesStayInTheirFolder) {
  for (const char* name : {"../escaped", "a/b"}) {
    std::ofstream(scene_) << scene_with(name, "");
    CompareOptions o = options({"mpm"});
    o.frames = 1;
    o.floors = false;
    o.pictures = folder_ + "/pictures";
    run_compare(o);
  }
  EXPECT_EQ(names_in(folder_ + "/pictures"), (std::vector<std::string>{".._escaped-mpm.png", "a_b-mpm.png"}));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/escaped-mpm.png"));
  CompareOptions twins = options({"mpm"});
  twins.scenes.push_back(folder_ + "/twin.json");
  std::ofstream(twins.scenes[1]) << scene_with("a_b", "");
  twins.pictures = folder_ + "/pictures";
  EXPECT_THAT([&] { run_compare(twins); }, ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("'a_b'")));
}

TEST_F(CompareRuns, EveryModelHasAPictureOfItsOwn) {
  const std::string weights = folder_ + "/mpm_coarse.safetensors";
  std::filesystem::copy_file("models/coarse-mpm.safetensors", weights);
  CompareOptions o = options({"mpm:coarse", weights});
  o.frames = 1;
  o.floors = false;
  o.pictures = folder_ + "/pictures";
  run_compare(o);
  EXPECT_EQ(names_in(o.pictures), (std::vector<std::string>{"small-mpm_coarse.png", "small-mpm_coarse_.png"}));
}

TEST_F(CompareRuns, RefusesFlagsOfWhatIsNotMade) {
  const auto expect_refused = [&](CompareOptions o, const char* flag) {
    o.models = {"missing.safetensors"};  // would be an InputError once the work begins
    EXPECT_THAT([&] { run_compare(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr(flag)));
  };
  CompareOptions o = options({});
  o.forces = true;
  expect_refused(o, "Add --report");
  o.report = folder_ + "/report.html";
  o.one_step_only = true;
  expect_refused(o, "--forces records rollouts");
  o.forces = false;
  o.pictures = folder_ + "/pictures";
  expect_refused(o, "--pictures");
}

TEST_F(CompareRuns, RefusesCudaWhereItCannotBe) {
  CompareOptions o = options({"mpm", ballistic_network()});
  o.device = "cuda";  // without a GPU; with one, since the network is not wide enough
  EXPECT_THAT([&] { make_comparison(o); }, ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("device 'cpu'")));
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

TEST_F(CompareRuns, AllScenesAndModelsThatDoNotGoTogetherAreToldBeforeTheWork) {
  const auto write = [&](const std::string& name, const std::string& extra, const std::string& domain) {
    const std::string file = folder_ + "/" + name + ".json";
    std::ofstream(file) << scene_with(name, extra, domain);
    return file;
  };
  // A truth that diverges would end the comparison before the second scene's turn.
  const char* endless = R"("time_step": { "policy": "fixed", "substeps_per_frame": 1 }, )";
  CompareOptions o = options({"mpm", ballistic_network(), folder_ + "/ballistic.safetensors:no-corrections"});
  o.scenes = {write("stiff", endless, ""), write("slow", R"("frame_time": 0.02, )", ""),
              write("flat", R"("frame_time": 0.03, )", ""), write("far", "", R"("origin": [5, 0, 0], )")};
  o.pictures = folder_ + "/new/pictures";
  o.json = folder_ + "/out.json";
  EXPECT_THAT([&] { run_compare(o); },
              ::testing::ThrowsMessage<ConfigError>(::testing::AllOf(
                  ::testing::HasSubstr("3 scenes, or pairs of scene and model, cannot be run"),
                  ::testing::HasSubstr("scene 'slow' ('" + o.scenes[1] + "') and model '" + o.models[1] + "'"),
                  ::testing::HasSubstr("another frame time (scene 0.020000 s"), ::testing::HasSubstr("scene 'flat'"),
                  ::testing::HasSubstr("scene 'far' ('" + o.scenes[3] + "'): obstacle 0"),
                  ::testing::HasSubstr("0.016667 s). Set the scene's frame_time to that"),
                  ::testing::Not(::testing::HasSubstr("'stiff'")))));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/new"));
  EXPECT_FALSE(std::filesystem::exists(o.json));
  o.scenes = {write("fine", "", "")};
  o.set = {"domain.dx=0.02"};
  EXPECT_THAT([&] { run_compare(o); },
              ::testing::ThrowsMessage<ConfigError>(
                  ::testing::AllOf(::testing::StartsWith("scene 'fine'"), ::testing::HasSubstr("(scene 0.020000 m"),
                                   ::testing::HasSubstr("0.031250 m). Set the scene's domain.dx to that"))));
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

}  // namespace
}  // namespace graupel::experiments
