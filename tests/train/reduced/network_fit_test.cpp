// Networks for branches: what they learn, that libtorch's forward pass and loss are rom's, that they repeat, and a
// small sweep from snapshots to rollouts with them.
#include "train/reduced/network_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/parallel/device.h"
#include "core/system/error.h"
#include "rom/fields/factored_fields.h"
#include "tests/train/curves.h"
#include "tests/train/gradient_check.h"
#include "tests/train/reduced/tiny_sweep.h"
#include "train/reduced/mlp/mlp_module.h"
#include "train/reduced/nsf_training.h"

namespace graupel::train {
namespace {

NetworkFitOptions quick() {
  NetworkFitOptions options;
  options.width = 24;
  options.steps = 1500;
  options.batch = 64;
  options.noise = 0;
  return options;
}

std::vector<double> row_of(const Eigen::MatrixXd& m, Eigen::Index row) {
  std::vector<double> values;
  for (Eigen::Index j = 0; j < m.cols(); ++j) values.push_back(m(row, j));
  return values;
}

TEST(NetworkFit, PredictsSmoothFunctionsOfRunsInBetween) {
  const Curves curves(9, 25, false);
  int said = 0;
  NetworkFitOptions options = quick();
  options.message = [&](const std::string& text) { said += text.find("network without run") == 0; };
  const NetworkFit fit = fit_network(curves.inputs, curves.outputs, curves.run, options);
  EXPECT_EQ(said, 4);
  EXPECT_LT(fit.held_out_error, 0.01);
  double worst = 0;
  for (Eigen::Index i = 0; i < curves.inputs.rows(); ++i) {
    double c[2];
    fit.map.evaluate(row_of(curves.inputs, i).data(), c);
    for (int k = 0; k < 2; ++k) worst = std::max(worst, std::abs(c[k] - curves.outputs(i, k)));
  }
  EXPECT_LT(worst, 0.03);
}

TEST(NetworkFit, RateMapsAreLinearInTheRates) {
  const Curves curves(9, 25, true);
  const NetworkFit fit = fit_rate_network(curves.inputs, curves.rates, curves.outputs, curves.run, quick());
  EXPECT_LT(fit.held_out_error, 0.02);
  double m[4];
  fit.map.evaluate(row_of(curves.inputs, 40).data(), m);
  for (int k = 0; k < 2; ++k)
    EXPECT_NEAR(m[2 * k] * curves.rates(40, 0) + m[2 * k + 1] * curves.rates(40, 1), curves.outputs(40, k), 0.05);
}

/// Nothing but a plane: the linear part is exact, and the network has nothing to add.
TEST(NetworkFit, APlaneIsItsLinearPart) {
  Curves curves(4, 10, false);
  curves.outputs.col(0) = 2 * curves.inputs.col(0) - curves.inputs.col(2);
  curves.outputs.col(1).setConstant(3);
  const NetworkFit fit = fit_network(curves.inputs, curves.outputs, curves.run, quick());
  EXPECT_LT(fit.held_out_error, 1e-6);
  const std::vector<double> far = {40, -7, 11};
  double c[2];
  fit.map.evaluate(far.data(), c);
  EXPECT_NEAR(c[0], 2 * 40 - 11, 1e-3);
  EXPECT_NEAR(c[1], 3, 1e-4);
}

/// Beside the curve that the inputs lie on, noise makes the network flat; along it, it remains near the truth.
TEST(NetworkFit, NoiseKeepsItFlatBesideTheStatesOfTheTraining) {
  Curves curves(1, 60, false);
  curves.inputs.col(1) = curves.inputs.col(0);
  curves.inputs.col(2) = 0.5 * curves.inputs.col(0);
  curves.outputs = curves.inputs.col(0).array().square().replicate(1, 2);
  const auto slope_beside = [&](double noise) {
    NetworkFitOptions options = quick();
    options.noise = noise;
    const NetworkFit fit = fit_network(curves.inputs, curves.outputs, curves.run, options);
    double sum = 0;
    for (Eigen::Index i = 0; i < 60; ++i) {
      double c[2], slope[6];
      fit.map.evaluate(row_of(curves.inputs, i).data(), c);
      EXPECT_NEAR(c[0], curves.outputs(i, 0), 0.1);
      fit.map.derivative(row_of(curves.inputs, i).data(), 3, slope);
      sum += std::abs(slope[0] - slope[1]);  // across the curve, which has equal first and second inputs
    }
    return sum / 60;
  };
  EXPECT_LT(slope_beside(0.1), 0.5 * slope_beside(0));
}

TEST(NetworkFit, RepeatsForASeedAndHasNoHeldOutErrorOfTwoRuns) {
  const Curves curves(2, 30, false);
  NetworkFitOptions options = quick();
  options.steps = 50;
  const auto tensors = [&](uint64_t seed) {
    options.seed = seed;
    nn::Weights weights;
    const NetworkFit fit = fit_network(curves.inputs, curves.outputs, curves.run, options);
    EXPECT_EQ(fit.held_out_error, 0);
    fit.map.store(weights, "m");
    return weights.tensors.at("m.layer3.weight").bytes;
  };
  EXPECT_EQ(tensors(1), tensors(1));
  EXPECT_NE(tensors(1), tensors(2));
}

TEST(NetworkFit, SaysThatARateIsTooHigh) {
  const Curves curves(2, 30, false);
  NetworkFitOptions options = quick();
  options.learning_rate = 1e12;
  try {
    fit_network(curves.inputs, curves.outputs, curves.run, options);
    FAIL() << "accepted a loss that is no number";
  } catch (const DivergedError& error) {
    EXPECT_NE(std::string(error.what()).find("branch_learning_rate"), std::string::npos) << error.what();
  }
}

/// A module without places and with rates, on data of its own.
struct Branch {
  static constexpr int64_t snapshots = 12;
  MlpShape shape;
  std::vector<float> states, rates, targets;
  MlpModule module;

  explicit Branch(int r)
      : shape{4, 0, 18, 6, 0, 0, r},
        states(noise(snapshots * 4, 1)),
        rates(noise(static_cast<std::size_t>(snapshots * r), 2)),
        targets(noise(static_cast<std::size_t>(snapshots * shape.targets()), 3)),
        module(shape, Device::cpu, 5, NumberType::f64) {
    module.set_states(states);
    if (r > 0) module.set_rates(rates);
    module.set_targets(targets, 1e9);
  }
  static std::vector<float> noise(std::size_t count, uint64_t stream) {
    const Random random(8, RandomPurpose::test, stream);
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<float>(random.uniform(i, 0, -1.5, 1.5));
    return values;
  }
  static MlpBatch all() {
    MlpBatch batch;
    for (int64_t i = 0; i < snapshots; ++i) batch.snapshots.push_back(i);
    batch.points = {0};
    return batch;
  }
};

TEST(NetworkFit, LibtorchAndTheEngineAgree) {
  for (const int r : {0, 2, 3}) {
    const Branch branch(r);
    std::vector<rom::MlpLayer> layers;
    const nn::Weights weights = branch.module.state(MlpArray::weights);
    for (int l = 0; l < rom::Mlp::layer_count; ++l) {
      const std::string name = "layer" + std::to_string(l);
      const int in = l == 0 ? 4 : 18, out = l == rom::Mlp::hidden_layers ? 6 : 18;
      layers.push_back({in, out, weights.get(name + ".weight", {out, in}), weights.get(name + ".bias", {out})});
    }
    const rom::Standardization input{std::vector<double>(4, 0), std::vector<double>(4, 1)},
        output{std::vector<double>(6, 0), std::vector<double>(6, 1)};
    const rom::MlpMap engine(rom::Mlp(std::move(layers), input, output), std::vector<double>(5 * 6, 0.0));
    const std::vector<double> expected = branch.module.predict(Branch::all());
    const auto targets = static_cast<std::size_t>(branch.shape.targets());
    ASSERT_EQ(expected.size(), targets * Branch::snapshots);
    for (std::size_t s = 0; s < Branch::snapshots; ++s) {
      double z[4], c[6];
      for (std::size_t i = 0; i < 4; ++i) z[i] = static_cast<double>(branch.states[4 * s + i]);
      engine.evaluate(z, c);
      for (std::size_t k = 0; k < targets; ++k) {
        double y = r > 0 ? 0 : c[k];
        for (std::size_t j = 0; j < static_cast<std::size_t>(r); ++j)
          y += c[k * static_cast<std::size_t>(r) + j] *
               static_cast<double>(branch.rates[s * static_cast<std::size_t>(r) + j]);
        EXPECT_NEAR(expected[targets * s + k], y, 1e-12);
      }
    }
  }
}

TEST(NetworkFit, TheGradientIsTheSlopeOfTheLoss) {
  for (const int r : {0, 3}) {
    Branch branch(r);
    expect_slope_of_loss(branch.module, Branch::all());
  }
}

class NetworkBranches : public testing::Test {
 protected:
  static void SetUpTestSuite() { folder_ = tiny_sweep("network_fit_test_data"); }

  static NsfTrainingOptions options() {
    NsfTrainingOptions options;
    options.data = folder_;
    options.config.branch = rom::BranchKind::mlp;
    options.config.branch_width = 24;
    options.config.branch_steps = 600;
    options.config.deformation_modes = 20;
    options.config.stress_modes = 30;
    options.config.affine_modes = 30;
    options.config.samples = 120;
    options.config.calibration_runs = 0;
    return options;
  }

  static inline std::string folder_;
};

TEST_F(NetworkBranches, RollOutAParameterThatTheyWereNotTrainedOn) {
  NsfReport report;
  const rom::ReducedModel model = train_factored(options(), report);
  for (const FieldReport* field : {&report.deformation, &report.stress, &report.affine}) {
    EXPECT_GT(field->held_out_error, 0);
    EXPECT_LT(field->held_out_error, 0.2);
  }
  const double own = displacement_error<double>(model, 29, {});
  EXPECT_LT(own, 0.03);
  const rom::ReducedModel stored = rom::ReducedModel::load(model.store(nn::DType::f32));
  EXPECT_LT(displacement_error<float>(stored, 29, {}), 0.03);
}

TEST_F(NetworkBranches, FollowRatesAndNoModesBeyondTheLatents) {
  NsfTrainingOptions rates = options();
  rates.config.affine = rom::AffineKind::rate;
  rates.config.deformation_modes = rates.config.latents;
  NsfReport report;
  const rom::ReducedModel model = rom::ReducedModel::load(train_factored(rates, report).store(nn::DType::f32));
  EXPECT_EQ(dynamic_cast<const rom::FactoredFields&>(*model.fields).deformation_branch().map().outputs(), 0);
  EXPECT_EQ(report.deformation.held_out_error, 0);
  EXPECT_LT(displacement_error<double>(model, 29, {}), 0.1);
}

TEST_F(NetworkBranches, AreTheSameBytesAgainForAnyNumberOfThreads) {
  NsfTrainingOptions few = options();
  few.config.branch_steps = 40;
  NsfReport report;
  const int threads = num_threads();
  const nn::Weights a = train_factored(few, report).store(nn::DType::f32);
  set_num_threads(1);
  const nn::Weights b = train_factored(few, report).store(nn::DType::f32);
  set_num_threads(threads);
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_EQ(tensor.bytes, b.tensors.at(name).bytes) << name;
}

}  // namespace
}  // namespace graupel::train
