// graph networks beside MPM: rows of both states, and what is refused.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "nn/weights.h"
#include "tests/apps/program.h"
#include "tests/graph/random_weights.h"

namespace graupel::test {
namespace {

TEST(BenchGraph, HasARowForEveryModelAndState) {
  const Folder folder;
  const Outcome outcome =
      graupel("bench graph --models mpm,models/hgn.safetensors --particles 900 --frames 2 --settle 3 --json " +
              folder.file("g.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  std::ifstream file(folder.file("g.json"));
  const auto rows = nlohmann::json::parse(file)["rows"];
  ASSERT_EQ(rows.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(rows[i]["state"], i < 2 ? "flying" : "settled");
    EXPECT_EQ(rows[i]["model"], i % 2 ? "models/hgn.safetensors" : "mpm");
    EXPECT_EQ(rows[i]["particles"], rows[0]["particles"]);
    EXPECT_GT(rows[i]["seconds_per_frame"].get<double>(), 0);
    EXPECT_GT(rows[i]["speed_against_mpm"].get<double>(), 0);
  }
  EXPECT_NEAR(rows[0]["particles"].get<double>(), 900, 500);
  EXPECT_EQ(rows[0]["speed_against_mpm"], 1.0);
  EXPECT_EQ(rows[0]["substeps_per_frame"], 54);
  EXPECT_LE(rows[1]["network"].get<double>(), rows[1]["seconds_per_frame"].get<double>());
}

TEST(BenchGraph, SpreadsABatchOverItsScenesAndKnowsTheRateOfProducts) {
  const Folder folder;
  ::setenv("GRAUPEL_SIMD", "baseline", 1);
  ::setenv("GRAUPEL_PRODUCTS", "f32", 1);
  const Outcome outcome = graupel(
      "bench graph --models mpm:coarse,models/hgn.safetensors --batch 3 --particles 900 --frames 2 --settle 2 " +
      std::string("--threads 1 --json ") + folder.file("g.json"));
  ::unsetenv("GRAUPEL_SIMD");
  ::unsetenv("GRAUPEL_PRODUCTS");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("baseline, f32 products")) << outcome.output;
  std::ifstream file(folder.file("g.json"));
  const auto json = nlohmann::json::parse(file);
  EXPECT_EQ(json["arithmetic"], "baseline, f32 products");
  const auto rows = json["rows"];
  ASSERT_EQ(rows.size(), 6U);
  EXPECT_EQ(rows[1]["scenes"], 3);
  EXPECT_FALSE(rows[0].contains("scenes"));
  const double ratio = rows[1]["seconds_per_frame"].get<double>() / rows[0]["seconds_per_frame"].get<double>();
  EXPECT_GT(ratio, 0.3);  // on one thread a scene of three takes what it takes alone
  EXPECT_LT(ratio, 3);
  EXPECT_LT(rows[2]["gflop_per_second"].get<double>(), json["product_gflop_per_second"].get<double>());
}

/// A network of 8 latents that lets particles fall, whatever it sees.
template <typename Config>
void write_tiny_network(const std::string& file, Config config) {
  config.latent = 8;
  config.message_passing = 2;
  graph::Normalization normalization;
  normalization.acceleration_mean[1] = static_cast<float>(-9.8 / 3600);
  nn::Weights weights = graph::random_weights(config, normalization);
  graph::silence_decoder(weights);
  nn::write_safetensors(file, weights);
}

TEST(BenchGraph, PutsTheSameNetworksInLibtorchBesideThem) {
  if (!std::filesystem::exists(GRAUPEL_BINARY_DIR "/graupel-train")) GTEST_SKIP() << "this build has no libtorch";
  const Folder folder;
  const std::string hgn = folder.file("hgn.safetensors"), gns = folder.file("gns.safetensors");
  graph::GnsConfig with_obstacles;
  with_obstacles.obstacle_particles = true;
  with_obstacles.obstacle_spacing = 0.02;
  write_tiny_network(hgn, graph::HgnConfig());
  write_tiny_network(gns, with_obstacles);
  const Outcome outcome = graupel("bench graph --libtorch --models " + hgn + "," + gns +
                                  " --particles 900 --frames 2 --settle 2 --threads 1 --json " + folder.file("g.json"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("(libtorch, split)") && outcome.says("network alone")) << outcome.output;
  std::ifstream file(folder.file("g.json"));
  const auto rows = nlohmann::json::parse(file)["rows"];
  ASSERT_EQ(rows.size(), 12U);  // two states, two networks: the engine, libtorch whole and split
  for (std::size_t i = 0; i < rows.size(); i += 3) {
    const auto &engine = rows[i], &whole = rows[i + 1], &split = rows[i + 2];
    const std::string model = i % 6 == 0 ? hgn : gns;
    EXPECT_EQ(engine["model"], model);
    EXPECT_EQ(whole["model"], model + " (libtorch)");
    EXPECT_EQ(split["model"], model + " (libtorch, split)");
    // Both programs count the same graph, obstacle particles included.
    EXPECT_EQ(split["flop"], engine["flop"]);
    EXPECT_GT(whole["flop"].get<double>(), engine["flop"].get<double>());
    EXPECT_DOUBLE_EQ(whole["over_engine_frame"].get<double>(),
                     whole["network"].get<double>() / engine["seconds_per_frame"].get<double>());
    EXPECT_DOUBLE_EQ(engine["gflop_per_second"].get<double>(),
                     1e-9 * engine["flop"].get<double>() / engine["network"].get<double>());
    EXPECT_EQ(split["threads"], 1);
  }
}

TEST(BenchGraph, SaysHowToGetLibtorch) {
  const Folder folder;
  std::filesystem::copy_file(GRAUPEL_BINARY_DIR "/graupel-bench", folder.file("graupel-bench"));
  const Outcome outcome = run_program(folder.file("graupel-bench"), "graph --libtorch --models mpm");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("graupel-train' is not there") && outcome.says("Install libtorch-dev")) << outcome.output;
}

TEST(BenchGraph, RefusesReducedModels) {
  const Outcome outcome = graupel("bench graph --models mpm,models/nsf-sand.safetensors");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("nsf-sand") && outcome.says("bench rom")) << outcome.output;
}

TEST(BenchGraph, RefusesRecipesOfCategories) {
  const Outcome outcome = graupel("bench graph --recipe scenes/recipes/general.json --models mpm --device cpu");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("'scenes/recipes/general.json' is a recipe of categories")) << outcome.output;
}

}  // namespace
}  // namespace graupel::test
