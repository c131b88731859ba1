// Training of the paper's networks on a small sweep: rollouts, stopped runs, both encoders, what is refused.
#include <gtest/gtest.h>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/train/reduced/tiny_sweep.h"
#include "tests/train/tiny_data.h"
#include "train/reduced/mlp_training.h"

namespace graupel::train {
namespace {

class MlpTraining : public testing::Test {
 protected:
  static void SetUpTestSuite() { data_ = tiny_sweep("mlp_test_data"); }

  /// A quick training in a folder of its own.
  static MlpTrainingOptions options(const std::string& name) {
    MlpTrainingOptions options;
    options.data = data_;
    options.run = test_folder(name);
    options.config.field = rom::FieldKind::mlp;
    options.config.latents = 4;
    options.config.samples = 120;
    MlpConfig& mlp = options.config.mlp;
    mlp.deformation_beta = mlp.stress_beta = mlp.affine_beta = 10;
    mlp.batch_snapshots = 16;
    mlp.batch_particles = 128;
    mlp.deformation_epochs = 2;
    mlp.field_epochs = 1;
    mlp.log_interval = 10;
    mlp.checkpoint_interval = 25;
    options.threads = 1;
    return options;
  }

  static inline std::string data_;
};

TEST_F(MlpTraining, LearnsTheSweepAndRollsItOut) {
  MlpTrainingOptions longer = options("long");
  longer.config.mlp.deformation_epochs = 16;
  longer.config.mlp.field_epochs = 6;
  MlpReport report, before;
  const auto model = train_mlp(longer, report), rough = train_mlp(options("short"), before);
  ASSERT_TRUE(model && rough);
  ASSERT_EQ(report.stages.size(), 3u);
  EXPECT_EQ(report.stages[0].name, "deformation");
  EXPECT_EQ(report.stages[0].width, 30);
  EXPECT_EQ(report.stages[0].steps, 910);  // 5 * 16 epochs of 182 / 16 steps
  EXPECT_LT(report.stages[0].error, 0.2);
  EXPECT_LT(report.stages[0].error, 0.6 * before.stages[0].error);
  for (const std::size_t field : {1u, 2u}) EXPECT_LT(report.stages[field].error, 0.95 * before.stages[field].error);
  const rom::ReducedModel stored = rom::ReducedModel::load(model->store(nn::DType::f32));
  EXPECT_STREQ(stored.fields->kind(), "mlp");
  // A body that stays where it is has an error of 1.
  EXPECT_LT(displacement_error<float>(stored, 29, {}), 0.3);
  EXPECT_LT(displacement_error<double>(*model, 29, {}), 0.3);
  remove_path(longer.run);
}

void expect_equal(const nn::Weights& a, const nn::Weights& b) {
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_EQ(tensor.bytes, b.tensors.at(name).bytes) << name;
}

TEST_F(MlpTraining, AStoppedRunGoesOnToTheSameWeights) {
  MlpReport report;
  const MlpTrainingOptions once = options("whole");
  const auto whole = train_mlp(once, report);
  ASSERT_TRUE(whole);
  MlpTrainingOptions parts = options("parts");
  for (const int64_t stop : {60, 140}) {  // of 114 + 57 + 57 steps: in the first and in the second stage
    parts.stop_step = stop;
    EXPECT_FALSE(train_mlp(parts, report));
    EXPECT_EQ(report.reason, StopReason::reached_stop_step);
    parts.resume = true;
  }
  parts.stop_step = 0;
  const auto resumed = train_mlp(parts, report);
  ASSERT_TRUE(resumed);
  expect_equal(whole->store(nn::DType::f32), resumed->store(nn::DType::f32));
  const std::string metrics = read_file(parts.run + "/metrics.csv");
  EXPECT_NE(metrics.find("step,stage,stage_step,seconds,loss"), std::string::npos) << metrics;
  EXPECT_THROW(train_mlp(once, report), ConfigError);  // holds a run already
  parts.config.mlp.learning_rate = 1e-2;
  EXPECT_THROW(train_mlp(parts, report), ConfigError);  // other settings than the checkpoint's
}

TEST_F(MlpTraining, TheConvolutionalEncoderGivesTheLatents) {
  MlpTrainingOptions conv = options("conv");
  conv.config.mlp.encoder = EncoderKind::conv;
  conv.config.cluster = 4;
  MlpReport report;
  const auto model = train_mlp(conv, report);
  ASSERT_TRUE(model);
  ASSERT_TRUE(model->conv_encoder);
  const rom::ReducedModel stored = rom::ReducedModel::load(model->store(nn::DType::f32));
  ASSERT_TRUE(stored.conv_encoder);
  std::vector<double> start(stored.reference.begin(), stored.reference.end());
  const std::vector<double> latent = stored.conv_encoder->encode(start);
  for (std::size_t j = 0; j < latent.size(); ++j) EXPECT_NEAR(latent[j], stored.start_latent[j], 1e-4);
  const Scene scene = column(29);
  rom::ReducedSolver<double> solver(stored, mpm::PreparedScene(scene, {.seed = scene.seed}), {29}, {});
  for (std::size_t j = 0; j < latent.size(); ++j) EXPECT_NEAR(solver.state().latent[j], latent[j], 1e-5);
}

TEST_F(MlpTraining, ATimeLimitEndsEveryStage) {
  MlpTrainingOptions limited = options("limited");
  limited.config.mlp.deformation_epochs = limited.config.mlp.field_epochs = 100000;
  limited.time_limit = 0.6;
  MlpReport report;
  EXPECT_TRUE(train_mlp(limited, report));
  for (const MlpStageReport& stage : report.stages) {
    EXPECT_GE(stage.seconds, 0.2);
    EXPECT_GT(stage.steps, 0);
  }
}

TEST(MlpConfig, WidthsAndLearningRatesAreThePapers) {
  MlpConfig config;
  EXPECT_EQ(config.width(48, 3), 144);
  EXPECT_EQ(config.width(64, 9), 192);
  config.widths = WidthRule::paper;
  EXPECT_EQ(config.width(48, 3), 144);
  EXPECT_EQ(config.width(64, 6), 384);
  EXPECT_EQ(config.width(64, 9), 576);
  const double rates[] = {1e-3, 5e-4, 2e-4, 1e-4, 5e-5};
  for (int i = 0; i < 5; ++i) {
    EXPECT_DOUBLE_EQ(config.rate_at(0.2 * i + 0.01), rates[i]);
    EXPECT_DOUBLE_EQ(config.rate_at(0.2 * i + 0.19), rates[i]);
  }
  EXPECT_DOUBLE_EQ(config.rate_at(1), rates[4]);
}

}  // namespace
}  // namespace graupel::train
