// graupel compare on scenes of all kinds, stored truths, recipes and data sets, with chaos floors of a file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "compare/report/report.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/comparison/scene_tasks.h"
#include "experiments/models/start_state.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"
#include "mpm/sampling.h"
#include "tests/compare/small_comparison.h"

namespace graupel::experiments {
namespace {

using compare::ModelResult;

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
  o.device = "cpu";  // as run_mpm()
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

TEST_F(CompareRuns, ATruthOfOtherParticlesIsNamedAndTheScenesBeforeItAreWritten) {
  const Scene scene = io::read_scene(scene_);
  Trajectory truth = run_mpm(scene, seeded(2)).run.trajectory;
  truth.scene_json = scene.source;
  truth.particle_type.back() = particle_type_of(MaterialModel::snow);
  for (ParticleFrame& frame : truth.frames) frame.velocity.resize(truth.particle_count());
  CompareOptions o = options({"mpm"});
  o.scenes.push_back(folder_ + "/truth.h5");
  o.frames = 2;
  o.floors = false;
  o.json = folder_ + "/out.json";
  io::TrajectoryWriter writer(o.scenes[1], truth);
  for (const ParticleFrame& frame : truth.frames) writer.append(frame);
  writer.finish();
  ::testing::internal::CaptureStdout();
  EXPECT_THAT([&] { run_compare(o); },
              ::testing::ThrowsMessage<InputError>(::testing::AllOf(
                  ::testing::StartsWith("scene 'truth#0' ('" + o.scenes[1] + "'): "), ::testing::HasSubstr("type snow"),
                  ::testing::HasSubstr("hold the 1 scene before"))));
  ::testing::internal::GetCapturedStdout();
  EXPECT_EQ(nlohmann::json::parse(read_file(o.json))["results"].size(), 1u);
}

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
  EXPECT_THAT([&] { make_comparison(o); },
              ::testing::ThrowsMessage<ConfigError>(::testing::HasSubstr("another number of dimensions (scene 2, '")));
  o.scenes.pop_back();
  for (const compare::SceneResult& scene : make_comparison(o).scenes) {
    EXPECT_EQ(scene.models[0].diverged_at_frame, -1) << scene.name;
    EXPECT_LT(scene.models[0].values.at("position_mse_20"), 0.05) << scene.name;
    EXPECT_GT(scene.models[0].values.at("position_mse_20"), 0) << scene.name;
  }
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
  o.device = "cpu";  // as run_mpm()
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
  o.scenes = {recipe, "7:9"};
  tasks = read_scene_tasks(o);
  ASSERT_EQ(tasks.size(), 2u);
  EXPECT_EQ(tasks[0].source, recipe + "#7");
  EXPECT_EQ(tasks[1].category, "dam_break");

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
  o.scenes = {recipe, "8:10"};
  EXPECT_THAT(refusal(), ::testing::HasSubstr("8:10 is more than"));
  for (const char* const word : {"0", "-1", "3:3", "4:2"}) {
    o.scenes = {recipe, word};
    EXPECT_THAT(refusal(), ::testing::HasSubstr("at least 1")) << word;
  }
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
  EXPECT_THAT(refusal(), ::testing::HasSubstr("--scenes 3 chooses scenes of recipes"));

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

}  // namespace
}  // namespace graupel::experiments
