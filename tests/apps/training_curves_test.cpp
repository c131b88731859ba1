#include "experiments/inspection/training_curves.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/system/error.h"
#include "tests/apps/program.h"

namespace graupel::experiments {
namespace {

namespace fs = std::filesystem;

class TrainingCurves : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("graupel_curves_" + std::to_string(::getpid()));
    fs::create_directories(folder_ / "run");
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string run(const std::string& rows,
                  const std::string& columns =
                      "step,seconds,loss,valid_one_step_raw,valid_zero_raw,valid_ballistic_raw,"
                      "valid_rollout_mse") const {
    std::ofstream(folder_ / "run" / "metrics.csv") << columns << "\n" << rows;
    return (folder_ / "run").string() + "/";
  }
  fs::path folder_;
};

TEST_F(TrainingCurves, ValidationsAreReadWithTheBetterBaseline) {
  const std::string folder =
      run("50,6,1.5,,,,\n100,12,1.2,2e-6,8e-6,4e-6,\n200,24,1,1e-6,2e-6,4e-6,0.25\n250,30,0.9,1e");
  EXPECT_TRUE(is_run_folder(folder));
  EXPECT_FALSE(is_run_folder(folder_.string()));
  const TrainingCurve curve = read_training_curve(folder);
  EXPECT_EQ(curve.name, "run");
  ASSERT_EQ(curve.validations.size(), 2u);  // the last row was being written when the run was killed
  EXPECT_DOUBLE_EQ(curve.validations[0].one_step, 0.5);
  EXPECT_TRUE(std::isnan(curve.validations[0].rollout_mse));
  EXPECT_DOUBLE_EQ(curve.validations[1].one_step, 0.5);
  EXPECT_DOUBLE_EQ(curve.validations[1].rollout_mse, 0.25);
  EXPECT_DOUBLE_EQ(curve.validations[1].seconds, 24);
  const auto json = to_json(curve);
  EXPECT_TRUE(json["validations"][0]["rollout_mse_m2"].is_null());
  EXPECT_DOUBLE_EQ(json["validations"][1]["minutes"].get<double>(), 0.4);
}

TEST_F(TrainingCurves, APlotOfNothingIsNotSilent) {
  const test::Outcome outcome =
      test::graupel("inspect " + run("50,6,1.5,,,,\n") + " --plots " + (folder_ / "plots").string());
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_TRUE(outcome.says("warning: no plot is written")) << outcome.output;
}

TEST_F(TrainingCurves, AValueThatWasCutShortIsNoMeasurement) {
  const std::string whole = "100,12,1.2,2e-6,8e-6,4e-6,\n";
  for (const char* cut : {"200,24,1,1e-6,2e-6,4e-6,0.2", "200,24,1,1e-6,2e-6,4e-6,2.5e-", "2"})
    EXPECT_EQ(read_training_curve(run(whole + cut)).validations.size(), 1u) << cut;
}

TEST_F(TrainingCurves, InspectTakesOneKindAtATime) {
  const std::string folder = run("100,12,1.2,2e-6,8e-6,4e-6,\n"), none = folder_.string();
  EXPECT_EQ(test::graupel("inspect " + folder).exit_code, 0);
  const test::Outcome recovered = test::graupel("inspect --recover " + folder),
                      mixed = test::graupel("inspect " + folder + " " + none);
  EXPECT_EQ(recovered.exit_code, 2);
  EXPECT_TRUE(recovered.says("--recover")) << recovered.output;
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_TRUE(mixed.says("'" + none + "' is no folder of a training run")) << mixed.output;
  EXPECT_EQ(test::graupel("inspect " + none + " --plots " + none).exit_code, 2);
}

TEST_F(TrainingCurves, PlotsAreThoseOfWhatWasMeasured) {
  const TrainingCurve curve = read_training_curve(run("100,60,1,2e-6,4e-6,8e-6,\n200,120,1,1e-6,4e-6,8e-6,\n"));
  const auto files = write_training_plots({curve}, (folder_ / "plots").string());
  ASSERT_EQ(files.size(), 1u);
  EXPECT_EQ(fs::path(files[0]).filename(), "one-step.svg");
  std::stringstream text;
  text << std::ifstream(files[0]).rdbuf();
  EXPECT_NE(text.str().find("minutes of training"), std::string::npos);
  EXPECT_NE(text.str().find(">run<"), std::string::npos);
}

TEST_F(TrainingCurves, OtherTablesAreErrorsThatNameThePlace) {
  const auto message = [&](const std::string& folder) {
    try {
      read_training_curve(folder);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message(run("1,2\n", "step,loss")).find("no column 'seconds'"), std::string::npos);
  EXPECT_NE(message(run("100,x,1,,,,\n")).find("row 1, column 'seconds': 'x'"), std::string::npos);
  EXPECT_NE(message(run("100,1\n200,2,1,,,,\n")).find("2 values in row 1"), std::string::npos);
  EXPECT_NE(message(folder_.string()).find("cannot be read"), std::string::npos);
}

}  // namespace
}  // namespace graupel::experiments
