// Training of a deformation alone: its tangents are derivatives, the gradient of its loss is the loss's slope, and an
// affine motion is learned with its deformation gradient and velocity.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "tests/train/gradient_check.h"
#include "tests/train/reduced/affine_sweep.h"
#include "tests/train/reduced/mlp_data.h"
#include "tests/train/reduced/tiny_sweep.h"
#include "tests/train/tiny_data.h"
#include "train/reduced/crom/crom_sweep.h"
#include "train/reduced/crom/crom_training.h"

namespace graupel::train {
namespace {

constexpr MlpShape with_tangents{.latents = 2, .width = 7, .outputs = 3, .tangents = true};

TEST(CromTangents, AreDerivativesOfTheNetwork) {
  const MlpModule module = module_of(with_tangents, NumberType::f64);
  const nn::Weights weights = module.state(MlpArray::weights);
  const std::vector<double> zero(5, 0.0), one(5, 1.0);
  const rom::Mlp net(rom::Mlp::load_layers(weights, "", 5, 7, 3), {zero, one}, {{0, 0, 0}, {1, 1, 1}});
  const MlpBatch batch{{4, 1}, {3, 69, 20}};
  const std::vector<double> got = module.predict(batch);
  const std::vector<float> x = noise(mlp_points * 3, 1), q = noise(mlp_snapshots * 2, 2),
                           rate = noise(mlp_snapshots * 2, 6);
  std::size_t row = 0;
  for (const int64_t s : batch.snapshots)
    for (const int64_t p : batch.points) {
      const auto i = static_cast<std::size_t>(s), j = static_cast<std::size_t>(p);
      rom::Mlp::Rows z(1, 5), y, slope;
      z << x[3 * j], x[3 * j + 1], x[3 * j + 2], q[2 * i], q[2 * i + 1];
      net.evaluate(z, y, slope);
      for (Eigen::Index c = 0; c < 3; ++c) {
        const auto value = [&](std::size_t stream) { return got[row * 15 + stream * 3 + static_cast<std::size_t>(c)]; };
        EXPECT_NEAR(value(0), y(0, c), 1e-12);
        for (Eigen::Index d = 0; d < 3; ++d) EXPECT_NEAR(value(1 + static_cast<std::size_t>(d)), slope(c, d), 1e-12);
        EXPECT_NEAR(value(4),
                    slope(c, 3) * static_cast<double>(rate[2 * i]) + slope(c, 4) * static_cast<double>(rate[2 * i + 1]),
                    1e-12);
      }
      ++row;
    }
}

TEST(CromTangents, GradientIsTheSlopeOfTheLoss) {
  MlpModule module = module_of(with_tangents, NumberType::f64);
  expect_slope_of_loss(module, {{0, 2, 3}, {1, 5, 60, 33, 12}});
}

class CromTraining : public testing::Test {
 protected:
  static void SetUpTestSuite() { data_ = affine_sweep("crom_test_data"); }

  static CromTrainingOptions options(const std::string& name) {
    CromTrainingOptions options;
    options.data = data_;
    options.run = test_folder(name);
    options.config.latents = 1;
    options.config.width = 16;
    options.config.batch_particles = 40;
    options.config.samples = 20;
    options.config.epochs_scale = 0.02;
    options.config.log_interval = 20;
    options.config.checkpoint_interval = 30;
    options.threads = 1;
    return options;
  }

  static inline std::string data_;
};

TEST_F(CromTraining, LearnsAnAffineMotionWithItsDerivatives) {
  CromTrainingOptions longer = options("crom_affine");
  longer.config.epochs_scale = 1;
  longer.config.learning_rate = 4e-3;
  CromReport report;
  const auto model = train_crom(longer, report);
  ASSERT_TRUE(model);
  ASSERT_TRUE(report.test);
  EXPECT_EQ(report.steps, 5525);  // 850 epochs of 52 / 8 steps
  for (const ReconstructionErrors& errors : {report.training, *report.test}) {
    EXPECT_LT(errors.displacement, 0.02);
    EXPECT_LT(errors.position, 0.1 * errors.displacement);
    EXPECT_LT(errors.gradient, 0.03);
    EXPECT_LT(errors.velocity, 0.06);
  }
  const rom::ReducedModel stored = rom::ReducedModel::load(model->store(nn::DType::f32));
  EXPECT_EQ(stored.contact_weight, 10);
  EXPECT_EQ(stored.kind, rom::ReducedKind::crom);
  EXPECT_TRUE(stored.fields->stress_follows_deformation());
}

/// Quadratic splines hold affine motions exactly.
TEST_F(CromTraining, ModesHoldAnAffineMotion) {
  CromTrainingOptions modes = options("crom_modes");
  modes.config.map = rom::DeformationKind::modes;
  CromReport report;
  const auto model = train_crom(modes, report);
  ASSERT_TRUE(model);
  ASSERT_TRUE(report.test);
  EXPECT_EQ(report.steps, 0);
  for (const ReconstructionErrors& errors : {report.training, *report.test}) {
    EXPECT_LT(errors.displacement, 2e-3);
    EXPECT_LT(errors.gradient, 5e-3);
    EXPECT_LT(errors.velocity, 2e-2);
  }
  EXPECT_STREQ(rom::ReducedModel::load(model->store(nn::DType::f32)).fields->kind(), "modes");
}

TEST_F(CromTraining, GradientTermsTeachTheGradients) {
  CromTrainingOptions with = options("crom_with"), without = options("crom_without");
  with.config.epochs_scale = without.config.epochs_scale = 0.1;
  without.config.gradient_weight = without.config.velocity_weight = 0;
  CromReport taught, untaught;
  ASSERT_TRUE(train_crom(with, taught));
  ASSERT_TRUE(train_crom(without, untaught));
  EXPECT_LT(taught.test->gradient, 0.7 * untaught.test->gradient);
}

void expect_equal(const nn::Weights& a, const nn::Weights& b) {
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_EQ(tensor.bytes, b.tensors.at(name).bytes) << name;
}

TEST_F(CromTraining, ASeedGivesTheSameWeightsInOneRunOrTwo) {
  CromReport report;
  const CromTrainingOptions once = options("crom_whole");
  const auto whole = train_crom(once, report);
  ASSERT_TRUE(whole);
  CromTrainingOptions parts = options("crom_parts");
  parts.stop_step = 47;
  EXPECT_FALSE(train_crom(parts, report));
  EXPECT_EQ(report.reason, StopReason::reached_stop_step);
  parts.stop_step = 0;
  parts.resume = true;
  const auto resumed = train_crom(parts, report);
  ASSERT_TRUE(resumed);
  expect_equal(whole->store(nn::DType::f32), resumed->store(nn::DType::f32));
  CromTrainingOptions other = options("crom_other");
  other.config.seed = 1;
  const auto different = train_crom(other, report);
  EXPECT_NE(whole->store(nn::DType::f32).tensors.at("deformation.layer1.weight").bytes,
            different->store(nn::DType::f32).tensors.at("deformation.layer1.weight").bytes);
}

TEST_F(CromTraining, ATimeLimitEndsIt) {
  CromTrainingOptions limited = options("crom_limited");
  limited.config.epochs_scale = 1e4;
  limited.time_limit = 0.4;
  CromReport report;
  EXPECT_TRUE(train_crom(limited, report));
  EXPECT_GT(report.steps, 0);
  EXPECT_LT(report.steps, 100000);
}

TEST_F(CromTraining, AsksForTheFieldsThatItNeeds) {
  try {
    const SnapshotSet set(data_ + "/train.h5", nsf_fields);
    FAIL() << "accepted runs without stress";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("lacks the field 'stress'"), std::string::npos) << error.what();
  }
  const std::string sand = new_sweep_folder("crom_without_gradient") + "/run.h5";
  const Trajectory run = run_of(column(30));
  io::TrajectoryWriteOptions write;
  write.fields = nsf_fields;
  io::TrajectoryWriter writer(sand, run, write);
  for (const ParticleFrame& frame : run.frames) writer.append(frame);
  writer.finish();
  try {
    const SnapshotSet set(sand, {ParticleField::deformation_gradient});
    FAIL() << "accepted a run without deformation gradients";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("lacks the field 'deformation_gradient'"), std::string::npos) << text;
    EXPECT_NE(text.find("crom_*.json"), std::string::npos) << text;
  }
  CromTrainingOptions apic = options("crom_apic");
  apic.data = affine_sweep("crom_apic_data", "apic");
  CromReport unused;
  EXPECT_THROW(train_crom(apic, unused), ConfigError);  // before it trains
  EXPECT_FALSE(std::filesystem::exists(apic.run + "/config.json"));
  CromTrainingOptions many = options("crom_many");
  many.config.latents = 32;
  CromReport report;
  EXPECT_THROW(train_crom(many, report), ConfigError);
}

TEST(CromConfig, LearningRatesAreThePapers) {
  const CromConfig config;
  const double epochs[] = {250, 600, 750, 825}, rates[] = {1e-3, 1e-4, 1e-5, 1e-6};
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(config.rate_at(epochs[i] / 850), rates[i], 1e-12);
  EXPECT_NEAR(config.rate_at(1), 1e-6, 1e-12);
}

}  // namespace
}  // namespace graupel::train
