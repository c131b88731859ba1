// graupel bench validate: its table, files, messages and exit codes, on a case that takes no time.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/apps/program.h"

namespace graupel::test {
namespace {

TEST(BenchValidate, PrintsARowForEveryFigureAndWritesThemAsJson) {
  const Folder folder;
  const Outcome outcome = graupel("bench validate --case kernel_moments --threads 1 --json " + folder.file("v.json"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_TRUE(outcome.says("| kernel_moments | sum of the weights - 1 |")) << outcome.output;
  std::ifstream stream(folder.file("v.json"));
  const auto json = nlohmann::json::parse(stream);
  EXPECT_EQ(json["form"], "short");
  ASSERT_EQ(json["cases"].size(), 1u);
  EXPECT_EQ(json["cases"][0]["checks"].size(), 6u);  // three moments of two splines
  EXPECT_EQ(json["cases"][0]["checks"][0]["passed"], true);
}

TEST(BenchValidate, WritesPlots) {
  const Folder folder;
  const Outcome outcome = graupel("bench validate --case shear_wave --threads 1 --plots " + folder.file("plots"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_GT(std::filesystem::file_size(folder.file("plots/shear_wave.svg")), 1000u);
}

TEST(BenchValidate, ListsItsCasesAndRefusesOthers) {
  const Outcome list = graupel("bench validate --list");
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_TRUE(list.says("dam_break")) << list.output;
  const Outcome unknown = graupel("bench validate --case dam_brake");
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_TRUE(unknown.says("unknown case 'dam_brake'. Did you mean 'dam_break'?")) << unknown.output;
  for (const char* flag : {"--device cuda", "--seed 3"}) {
    const Outcome refused = graupel(std::string("bench validate --case kernel_moments ") + flag);
    EXPECT_EQ(refused.exit_code, 2) << refused.output;
  }
}

}  // namespace
}  // namespace graupel::test
