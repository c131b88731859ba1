// Coarse MPM with trained constants through the verbs: rollout, inspect, and what is refused.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "core/system/atomic_file.h"
#include "hybrid/coarse_model.h"
#include "io/trajectory/trajectory_file.h"
#include "tests/apps/program.h"

namespace graupel::test {
namespace {

constexpr const char* scene = "scenes/shared/water_steps.json";

class CoarseMpm : public ::testing::Test {
 protected:
  void SetUp() override { nn::write_safetensors(model_, hybrid::CoarseModel().store()); }
  Outcome rollout(const std::string& flags) const {
    return graupel("rollout " + model_ + " " + scene + " --device cpu -o " + folder_.file("out.h5") + " " + flags);
  }

  Folder folder_;
  std::string model_ = folder_.file("coarse.safetensors");
};

TEST_F(CoarseMpm, RollsOutTheScenesOwnParticles) {
  const Outcome run = rollout("--frames 4 --json " + folder_.file("out.json"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto summary = nlohmann::json::parse(read_file(folder_.file("out.json")));
  EXPECT_EQ(summary.at("frames"), 4);
  EXPECT_EQ(summary.at("particles"), 3785);
  EXPECT_GT(summary.at("resolution"), 1);
  EXPECT_LT(summary.at("moved_particles"), summary.at("particles"));
  ASSERT_EQ(
      graupel(std::string("simulate ") + scene + " --device cpu --frames 4 -o " + folder_.file("mpm.h5")).exit_code, 0);
  const Trajectory own = io::TrajectoryReader(folder_.file("out.h5")).read(0),
                   truth = io::TrajectoryReader(folder_.file("mpm.h5")).read(0);
  ASSERT_EQ(own.particle_type, truth.particle_type);
  EXPECT_EQ(own.frames[0].position, truth.frames[0].position);
  double error = 0, moved = 0;
  for (std::size_t p = 0; p < own.particle_type.size(); ++p) {
    error += static_cast<double>(norm2(own.frames[4].position[p] - truth.frames[4].position[p]));
    moved += static_cast<double>(norm2(truth.frames[4].position[p] - truth.frames[0].position[p]));
  }
  EXPECT_LT(error, 1e-3 * moved);
}

TEST_F(CoarseMpm, FlagsOfOtherModelsAreRefused) {
  for (const char* flag : {"--density-limit 1", "--no-project", "--no-free-flight", "--refine 10", "--stride 2",
                           "--f64", "--step-factor 1", "--start truth:6", "--load 0:1:0,0,0:1:1,0,0"}) {
    const Outcome run = rollout(flag);
    EXPECT_EQ(run.exit_code, 2) << flag;
    EXPECT_TRUE(run.says("is coarse MPM. Leave it out")) << run.output;
  }
}

TEST_F(CoarseMpm, PartsAndTimesOfNetworksAreRefused) {
  const Outcome parts = graupel("compare --scenes " + std::string(scene) + " --models " + model_ + ":no-corrections");
  EXPECT_EQ(parts.exit_code, 2);
  EXPECT_TRUE(parts.says("that has no corrections")) << parts.output;
}

TEST_F(CoarseMpm, DamagedFilesAreRefused) {
  nn::Weights weights = hybrid::CoarseModel().store();
  weights.tensors.erase("log_courant");
  nn::write_safetensors(model_, weights);
  const Outcome run = rollout("--frames 1");
  EXPECT_EQ(run.exit_code, 3) << run.output;
  EXPECT_TRUE(run.says("log_courant")) << run.output;
}

/// In the first line, beside the networks.
TEST_F(CoarseMpm, TheReportOfTheDemoSaysWhatItWins) {
  const std::string report = folder_.file("report.html");
  const Outcome run = graupel("demo --frames 2 --device cpu -o " + report);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const std::string html = read_file(report);
  const std::size_t first = html.find("<div id=\"verdicts\">");
  ASSERT_NE(first, std::string::npos);
  const std::string verdicts = html.substr(first, html.find("</div>", first) - first);
  for (const char* model : {"coarse-mpm", "hgn"}) {
    const std::regex sentence("<p class=\"verdict[^>]*>" + std::string(model) +
                              "[^<]* mpm:coarse:fast, the strongest cheap rival, on 3 scenes");
    EXPECT_TRUE(std::regex_search(verdicts, sentence)) << verdicts;
  }
}

TEST_F(CoarseMpm, TrainingNeedsARecipeOfCategories) {
  if (!training_is_built()) GTEST_SKIP() << "graupel-train is not built (needs libtorch)";
  const Outcome run = graupel(std::string("train coarse --recipe ") + scene + " --out " + folder_.file("run"));
  EXPECT_EQ(run.exit_code, 2) << run.output;
  EXPECT_TRUE(run.says("is no recipe of categories")) << run.output;
  EXPECT_FALSE(std::filesystem::exists(folder_.file("run")));
}

}  // namespace
}  // namespace graupel::test
