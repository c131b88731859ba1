// graph networks beside MPM: rows of both states, and what is refused.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/apps/program.h"

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

TEST(BenchGraph, RefusesReducedModels) {
  const Outcome outcome = graupel("bench graph --models mpm,models/nsf-sand.safetensors");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_TRUE(outcome.says("nsf-sand") && outcome.says("bench rom")) << outcome.output;
}

}  // namespace
}  // namespace graupel::test
