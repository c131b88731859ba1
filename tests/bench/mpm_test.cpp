// graupel bench mpm: the table for the CPU, and the choice of an instruction set.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/apps/program.h"

namespace graupel::test {
namespace {

TEST(BenchMpm, TheTableHasBothPrecisionsAndTheInstructionSetThatTheEnvironmentNames) {
  const Folder folder;
  ::setenv("GRAUPEL_SIMD", "baseline", 1);
  const Outcome outcome =
      graupel("bench mpm --table cpu --material sand --particles 64 --threads 1 --json " + folder.file("t.json"));
  ::unsetenv("GRAUPEL_SIMD");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("baseline") && outcome.says("f32") && outcome.says("f64")) << outcome.output;
  std::ifstream file(folder.file("t.json"));
  const auto rows = nlohmann::json::parse(file)["rows"];
  ASSERT_EQ(rows.size(), 2U);
  for (const auto& row : rows) {
    EXPECT_EQ(row["instruction_set"], "baseline");
    EXPECT_EQ(row["threads"], 1);
    EXPECT_GT(row["updates_per_second"].get<double>(), 0);
  }
}

TEST(BenchMpm, AnUnknownInstructionSetAndATableOfAnotherDeviceAreRefused) {
  ::setenv("GRAUPEL_SIMD", "sse9", 1);
  const Outcome unknown = graupel("bench mpm --particles 64 --device cpu");
  const Outcome of_network = graupel("rollout models/hgn.safetensors scenes/shared/mixed_bowl.json --frames 1");
  ::unsetenv("GRAUPEL_SIMD");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(unknown.says("GRAUPEL_SIMD") && unknown.says("sse9, allowed here: baseline")) << unknown.output;
  EXPECT_EQ(of_network.output, unknown.output);
  const Outcome device = graupel("bench mpm --table cpu --device cuda");
  EXPECT_EQ(device.exit_code, 2);
  EXPECT_TRUE(device.says("--table cpu measures the CPU")) << device.output;
}

TEST(BenchMpm, RefusesRecipesOfCategories) {
  const Outcome outcome = graupel("bench mpm --recipe scenes/recipes/general.json --device cpu");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("'scenes/recipes/general.json' is a recipe of categories")) << outcome.output;
}

TEST(BenchMpm, ScenesOfACategoryAreTimedByTheTunedAndThePortableKernels) {
  const Folder folder;
  const std::string recipe = "bench mpm --recipe scenes/recipes/general.json --device cpu --frames 1 ";
  const Outcome outcome = graupel(recipe + "--category stream --json " + folder.file("t.json"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  std::ifstream file(folder.file("t.json"));
  const auto rows = nlohmann::json::parse(file)["rows"];
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["kernels"], "tuned");
  EXPECT_EQ(rows[1]["kernels"], "portable");
  for (const auto& row : rows) {
    EXPECT_EQ(row["category"], "stream");
    EXPECT_EQ(row["particles"], rows[0]["particles"]);
    EXPECT_GT(row["seconds_per_frame"].get<double>(), 0);
  }
  const Outcome both = graupel(recipe + "--category stream --portable");
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_TRUE(both.says("--portable excludes --category")) << both.output;
  const Outcome nameless = graupel("bench mpm --category stream --device cpu");
  EXPECT_EQ(nameless.exit_code, 2);
  EXPECT_TRUE(nameless.says("--category needs a recipe of categories")) << nameless.output;
}

}  // namespace
}  // namespace graupel::test
