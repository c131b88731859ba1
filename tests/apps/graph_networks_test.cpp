// The verbs take a GNS as they take an HGN.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/scene/material_config.h"
#include "io/trajectory/trajectory_file.h"
#include "nn/weights.h"
#include "program.h"
#include "tests/graph/random_weights.h"

namespace graupel::test {
namespace {

/// A GNS with obstacle particles whose acceleration is g dt^2 whatever it sees.
nn::Weights ballistic_gns() {
  graph::GnsConfig config;
  config.latent = 8;
  config.message_passing = 2;
  config.hidden_layers = 1;
  config.obstacle_particles = true;
  config.obstacle_spacing = 0.02;
  config.cell_normal = false;
  graph::Normalization normalization;
  normalization.acceleration_mean[1] = static_cast<float>(-9.8 / 3600);
  nn::Weights weights = graph::random_weights(config, normalization);
  graph::silence_decoder(weights);
  return weights;
}

TEST(GraphNetworks, AGnsRollsOutIsInspectedAndCompared) {
  const Folder folder;
  nn::write_safetensors(folder.file("gns.safetensors"), ballistic_gns());
  const std::string scene = folder.write(
      "small.json", small_scene(R"("obstacles": [{"shape": "sphere", "radius": 0.1, "position": [0.5, 0.3, 0.5]}])"));
  const Outcome rollout = graupel("rollout " + folder.file("gns.safetensors") + " " + scene + " -o " +
                                  folder.file("out.h5") + " --frames 4 --threads 1");
  ASSERT_EQ(rollout.exit_code, 0) << rollout.output;
  const io::TrajectoryReader reader(folder.file("out.h5"));
  const Trajectory header = reader.header(0);
  EXPECT_EQ(header.frame_count(), 5u);
  EXPECT_GT(header.particle_count(), 100u);
  for (const int32_t type : header.particle_type) EXPECT_NE(type, obstacle_particle_type);

  const std::string again = "rollout " + folder.file("gns.safetensors") + " " + scene + " -o " +
                            folder.file("again.h5") + " --frames 1 --density-limit ";
  EXPECT_EQ(graupel(again + "0 --no-free-flight").exit_code, 0);
  for (const char* unusable : {"-1", "10.5", "many"}) {
    const Outcome refused = graupel(again + unusable);
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_TRUE(refused.says("(allowed: a number, 0 to 10)")) << refused.output;
  }

  const Outcome inspect = graupel("inspect " + folder.file("gns.safetensors"));
  EXPECT_EQ(inspect.exit_code, 0) << inspect.output;
  EXPECT_TRUE(inspect.says("architecture: gns")) << inspect.output;
  EXPECT_TRUE(inspect.says("gns.obstacle_particles: true")) << inspect.output;

  const Outcome compare =
      graupel("compare --scenes " + scene + " --models mpm:coarse," + folder.file("gns.safetensors") +
              " --frames 4 --density-limit 1.2 --no-floors --threads 1 --json " + folder.file("out.json"));
  ASSERT_EQ(compare.exit_code, 0) << compare.output;
  EXPECT_TRUE(compare.says("gns")) << compare.output;
}

TEST(GraphNetworks, RollOutAllTrajectoriesOfADataSet) {
  const Folder folder;
  const std::string weights = folder.file("gns.safetensors"), data = folder.file("data.h5");
  nn::write_safetensors(weights, ballistic_gns());
  std::vector<std::string> parts;
  for (const char* size : {"0.15", "0.1"}) {
    const std::string scene =
        folder.write("scene.json", small_scene("", std::string(R"({"shape": "box", "size": [0.1, 0.1, )") + size +
                                                       R"(], "position": [0.5, 0.6, 0.5], "material": "water"})"));
    parts.push_back(folder.file(std::string(size) + ".h5"));
    ASSERT_EQ(graupel("simulate " + scene + " -o " + parts.back() + " --frames 8 --device cpu").exit_code, 0);
  }
  io::merge_trajectories(parts, data);

  const std::string all = "rollout " + weights + " " + data + " --all --start truth:6 -o ";
  const Outcome outcome = graupel(all + folder.file("all.h5") + " --json " + folder.file("all.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("2 trajectories, 6 frames")) << outcome.output;
  const io::TrajectoryReader reader(folder.file("all.h5"));
  ASSERT_EQ(reader.count(), 2);
  std::ifstream file(folder.file("all.json"));
  const auto rows = nlohmann::json::parse(file)["rows"];
  ASSERT_EQ(rows.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    const std::string one = folder.file("one.h5");
    ASSERT_EQ(
        graupel("rollout " + weights + " " + data + " --start truth:6 -o " + one + " --trajectory " + std::to_string(i))
            .exit_code,
        0);
    const Trajectory expected = io::TrajectoryReader(one).read(0), actual = reader.read(i);
    ASSERT_EQ(actual.frame_count(), 4u);
    for (std::size_t f = 0; f < 4; ++f) EXPECT_EQ(actual.frames[f].position, expected.frames[f].position);
    EXPECT_EQ(actual.scene_json, expected.scene_json);
    EXPECT_EQ(rows[static_cast<std::size_t>(i)]["particles"], expected.particle_count());
    EXPECT_GT(rows[static_cast<std::size_t>(i)]["position_mse_all"].get<double>(), 0);
  }
  EXPECT_FALSE(std::filesystem::exists(folder.file("all.h5.parts")));
}

TEST(GraphNetworks, NoErrorIsToldWhereNoParticleIsInBothRuns) {
  const Folder folder;
  const std::string weights = folder.file("gns.safetensors"), scene = folder.write("scene.json", small_scene());
  const std::string run = folder.file("run.h5"), gone = folder.file("gone.h5"), json = folder.file("out.json");
  nn::write_safetensors(weights, ballistic_gns());
  ASSERT_EQ(graupel("simulate " + scene + " -o " + run + " --frames 3 --device cpu").exit_code, 0);
  Trajectory of_run = io::TrajectoryReader(run).read(0);
  io::TrajectoryWriter writer(gone, of_run, {.velocity = true, .active = true});
  for (std::size_t f = 0; f < of_run.frames.size(); ++f) {
    of_run.frames[f].active.assign(of_run.particle_count(), f == 0 ? 1 : 0);
    writer.append(of_run.frames[f]);
  }
  writer.finish();
  for (const std::string all : {"", " --all"}) {
    const Outcome outcome = graupel("rollout " + weights + " " + gone + all + " -o " + folder.file("out.h5") +
                                    " --frames 3 --device cpu --json " + json);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
    EXPECT_TRUE(outcome.says("no particle to compare over")) << outcome.output;
    std::ifstream file(json);
    const auto result = nlohmann::json::parse(file);
    for (const char* key : {"position_mse_20", "position_mse_all"})
      EXPECT_TRUE(result.contains(key) && result.at(key).is_null()) << result.dump(1);
  }
}

TEST(GraphNetworks, RefuseAllWhereThereIsOne) {
  const Folder folder;
  const std::string weights = folder.file("gns.safetensors");
  nn::write_safetensors(weights, ballistic_gns());
  const auto expect_refused = [&](const std::string& arguments, const std::string& text) {
    const Outcome refused = graupel("rollout " + arguments + " -o " + folder.file("out.h5"));
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
    EXPECT_TRUE(refused.says(text)) << refused.output;
  };
  expect_refused(weights + " scenes/shared/water_steps.json --all", "--all needs a data set (.h5)");
  expect_refused(weights + " data.h5 --all --trajectory 1", "--all and --trajectory do not go together");
  expect_refused("models/nsf-sand.safetensors data.h5 --all", "--all is of graph networks");
  expect_refused("models/coarse-mpm.safetensors data.h5 --all", "--all is of graph networks");
}

TEST(GraphNetworks, RollOutScenesThatChange) {
  const Folder folder;
  nn::write_safetensors(folder.file("gns.safetensors"), ballistic_gns());
  const std::string paddle =
      R"("obstacles": [{"shape": "box", "size": [0.1, 0.2, 0.3], "position": [0.3, 0.5, 0.5],
                        "motion": {"velocity": [2, 0, 0]}}])";
  const std::string scene = folder.write("changing.json", small_scene(paddle + R"(,
    "emitters": [{"shape": "box", "size": [0.1, 0.04, 0.1], "position": [0.7, 0.8, 0.5], "velocity": [0, -1, 0],
                  "end_time": 0.15, "material": "water"}],
    "sinks": [{"shape": "box", "size": [0.2, 0.1, 0.2], "position": [0.7, 0.7, 0.5]}])"));
  const std::string network = "rollout " + folder.file("gns.safetensors") + " ";
  const std::string out = " -o " + folder.file("out.h5") + " --threads 1";
  const auto active_counts = [&] {
    std::vector<int64_t> counts;
    for (const ParticleFrame& frame : io::TrajectoryReader(folder.file("out.h5")).frames(0, 0, 13))
      counts.push_back(std::count(frame.active.begin(), frame.active.end(), 1));
    return counts;
  };
  const Outcome rollout = graupel(network + scene + out);
  ASSERT_EQ(rollout.exit_code, 0) << rollout.output;
  const std::vector<int64_t> counts = active_counts();
  EXPECT_LT(counts[0], counts[4]);
  EXPECT_LT(counts[12], counts[8]) << "what the sink took is gone";

  ASSERT_EQ(graupel("simulate " + scene + " --threads 1 -o " + folder.file("mpm.h5")).exit_code, 0);
  const Outcome later = graupel(network + folder.file("mpm.h5") + out + " --start truth:6");
  ASSERT_EQ(later.exit_code, 0) << later.output;
  const auto frames = io::TrajectoryReader(folder.file("out.h5")).frames(0, 0, 8);
  EXPECT_DOUBLE_EQ(frames[0].time, 5.0 / 60) << "obstacles go on from there";
  EXPECT_EQ(frames[0].active, io::TrajectoryReader(folder.file("mpm.h5")).frames(0, 5, 1)[0].active);

  const std::string moving = folder.write("moving.json", small_scene(paddle));
  const Outcome compare = graupel("compare --scenes " + moving + " --models " + folder.file("gns.safetensors") +
                                  " --frames 4 --no-floors --threads 1");
  EXPECT_EQ(compare.exit_code, 0) << compare.output;
}

TEST(GraphNetworks, DamagedAndForeignWeightsAreRefused) {
  const Folder folder;
  const std::string scene = folder.write("small.json", small_scene());
  nn::Weights weights = ballistic_gns();
  weights.tensors.erase("step.1.edge.layer1.weight");
  nn::write_safetensors(folder.file("cut.safetensors"), weights);
  const std::string end = " " + scene + " -o " + folder.file("out.h5");
  const Outcome cut = graupel("rollout " + folder.file("cut.safetensors") + end);
  EXPECT_EQ(cut.exit_code, 3);
  EXPECT_TRUE(cut.says("'step.1.edge.layer1.weight' is missing")) << cut.output;
  weights.metadata["architecture"] = "segnn";
  nn::write_safetensors(folder.file("other.safetensors"), weights);
  const Outcome other = graupel("rollout " + folder.file("other.safetensors") + end);
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_TRUE(other.says("'segnn', supported: 'hgn', 'gns'")) << other.output;
}

}  // namespace
}  // namespace graupel::test
