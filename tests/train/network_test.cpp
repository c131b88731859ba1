// The network's passes: gradient against finite differences, independence of batching and of worker order.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/parallel/device.h"
#include "graph/features/features.h"
#include "tests/gpu_only.h"
#include "tests/train/rounded_reference.h"
#include "train/networks/network_module.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {
namespace {

using graph::Aggregation;

graph::HgnConfig tiny_config(Aggregation aggregation = Aggregation::messages) {
  graph::HgnConfig config;
  config.latent = 8;
  config.levels = 3;
  config.message_passing = 2;
  config.embedding = 3;
  config.history = 2;
  config.aggregation = aggregation;
  return config;
}

/// A cloud of particles with random features and targets.
SceneGraph random_graph(const graph::HgnConfig& config, uint64_t seed, int particles, double edge) {
  const Random random(seed, RandomPurpose::test);
  std::vector<Vec3f> position;
  SceneGraph scene;
  for (int i = 0; i < particles; ++i) {
    const auto draw = static_cast<uint64_t>(i);
    position.push_back({static_cast<float>(random.uniform(draw, 0, 0.3, 0.3 + edge)),
                        static_cast<float>(random.uniform(draw, 1, 0.3, 0.3 + edge)),
                        static_cast<float>(random.uniform(draw, 2, 0.3, 0.3 + edge))});
    scene.type_row.push_back(static_cast<int32_t>(random.integer(draw, 3, graph::embedding_rows)));
  }
  const int64_t width = config.input_width() - config.embedding;
  for (int64_t i = 0; i < particles * (width + config.output_width()); ++i) {
    double a, b;
    random.normal(1000000 + static_cast<uint64_t>(i), 0, a, b);
    (i < particles * width ? scene.features : scene.target).push_back(static_cast<float>(a));
  }
  scene.hierarchy =
      sparsegrid::build_hierarchy<3>(position, config.spacing, {-0.01, -0.02, 0}, static_cast<int>(config.levels));
  return scene;
}

/// Largest difference between the gradient and central differences, relative to the largest gradient of that tensor.
void check_gradient(const graph::HgnConfig& config, const Batch& batch) {
  NetworkModule module(config, Device::cpu, 5, NumberType::f64);
  std::vector<double> gradient;
  module.loss_and_gradient(batch, &gradient);
  const ParameterLayout layout(config);
  const Random random(1, RandomPurpose::test, 9);
  constexpr double step = 1e-5;
  for (const Parameter& parameter : layout.parameters()) {
    double scale = 0;
    for (int64_t i = 0; i < parameter.count; ++i)
      scale = std::max(scale, std::abs(gradient[static_cast<std::size_t>(parameter.begin + i)]));
    for (uint64_t draw = 0; draw < 4; ++draw) {
      const int64_t i = parameter.begin + random.integer(draw, 0, static_cast<uint32_t>(parameter.count));
      module.nudge(i, step);
      const double above = module.loss(batch);
      module.nudge(i, -2 * step);
      const double below = module.loss(batch);
      module.nudge(i, step);
      EXPECT_NEAR(gradient[static_cast<std::size_t>(i)], (above - below) / (2 * step), 1e-5 * scale + 1e-8)
          << parameter.name << " number " << i - parameter.begin;
    }
  }
}

class EitherAggregation : public testing::TestWithParam<Aggregation> {};

TEST_P(EitherAggregation, GradientAgreesWithFiniteDifferences) {
  const graph::HgnConfig config = tiny_config(GetParam());
  check_gradient(config, concatenate({random_graph(config, 1, 40, 0.15), random_graph(config, 2, 25, 0.3)}));
}

TEST_P(EitherAggregation, GradientWithOddWidthAndOneLevel) {
  graph::HgnConfig config = tiny_config(GetParam());
  config.latent = 9;
  config.levels = 1;
  config.message_passing = 3;
  check_gradient(config, concatenate({random_graph(config, 3, 20, 0.1)}));
}

TEST_P(EitherAggregation, GradientWhereTheTopLevelHasNoEdges) {
  graph::HgnConfig config = tiny_config(GetParam());
  config.levels = 6;
  const Batch batch = concatenate({random_graph(config, 4, 12, 0.02)});
  ASSERT_EQ(batch.level.back().edges, 0);
  check_gradient(config, batch);
}

TEST_P(EitherAggregation, GradientOfABundleOfFrames) {
  graph::HgnConfig config = tiny_config(GetParam());
  config.bundle = 3;
  check_gradient(config, concatenate({random_graph(config, 1, 40, 0.15), random_graph(config, 2, 25, 0.3)}));
}

TEST(NetworkModule, TheLossOfABundleIsTheMeanOverItsFrames) {
  graph::HgnConfig config = tiny_config();
  config.bundle = 4;
  NetworkModule module(config, Device::cpu, 3, NumberType::f64);
  const Batch batch = concatenate({random_graph(config, 5, 30, 0.2)});
  ASSERT_EQ(batch.target_width, 12);
  const std::vector<float> predicted = module.predict(batch, StateArray::weights);
  ASSERT_EQ(predicted.size(), 12u * 30u);
  ASSERT_GT(batch.uncounted, 0);  // which do not count
  double sum = 0;
  for (std::size_t i = 0; i < predicted.size(); ++i)
    if (!graph::is_kinematic_row(batch.indices[static_cast<std::size_t>(batch.type_row.begin) + i / 12]))
      sum += std::pow(predicted[i] - batch.numbers[static_cast<std::size_t>(batch.target.begin) + i], 2);
  EXPECT_NEAR(module.loss(batch), sum / (static_cast<double>(30 - batch.uncounted) * 4), 1e-5 * sum);
}

INSTANTIATE_TEST_SUITE_P(NetworkModule, EitherAggregation,
                         testing::Values(Aggregation::messages, Aggregation::activations),
                         [](const auto& param) { return word_of(param.param); });

TEST(NetworkModule, ABatchGivesEachSceneItsOwnPrediction) {
  const graph::HgnConfig config = tiny_config();
  const NetworkModule module(config, Device::cpu, 3);
  const SceneGraph a = random_graph(config, 5, 30, 0.2), b = random_graph(config, 6, 50, 0.1);
  std::vector<float> one_by_one = module.predict(concatenate({a}), StateArray::weights);
  const std::vector<float> second = module.predict(concatenate({b}), StateArray::weights);
  one_by_one.insert(one_by_one.end(), second.begin(), second.end());
  const std::vector<float> together = module.predict(concatenate({a, b}), StateArray::weights);
  ASSERT_EQ(together.size(), one_by_one.size());
  for (std::size_t i = 0; i < together.size(); ++i) EXPECT_NEAR(together[i], one_by_one[i], 1e-5f);
}

graph::HgnConfig config_with_kernels() {
  graph::HgnConfig config = tiny_config(Aggregation::activations);
  config.latent = 128;
  config.embedding = 16;
  config.history = 5;
  return config;
}

TEST(RoundedReference, IsTheExactGradientWhereNothingIsRounded) {
  graph::HgnConfig config = tiny_config(Aggregation::activations);
  const Batch batch = concatenate({random_graph(config, 1, 40, 0.15), random_graph(config, 2, 25, 0.3)});
  NetworkModule exact(config, Device::cpu, 5, NumberType::f64);
  std::vector<double> expected;
  const double loss = exact.loss_and_gradient(batch, &expected);
  const RoundedReference reference = rounded_reference(config, 5, batch, {.rounds = false});
  EXPECT_NEAR(reference.loss, loss, 1e-12 * loss);
  expect_gradients_near(config, reference.gradient, expected, 1e-9);
  // Rounding to bf16 changes it, by far more than that and by far less than the gradient.
  const RoundedReference rounded = rounded_reference(config, 5, batch);
  EXPECT_NEAR(rounded.loss, loss, 3e-2 * loss);
  EXPECT_NE(rounded.loss, reference.loss);
}

/// Many scenes of one kind: upper levels have few cells in each.
Batch scenes_of(const graph::HgnConfig& config, uint64_t count, int particles, double edge) {
  std::vector<SceneGraph> scenes;
  for (uint64_t seed = 0; seed < count; ++seed) scenes.push_back(random_graph(config, 4 + seed, particles, edge));
  return concatenate(scenes);
}

TEST(MixedPrecision, GradientIsThatOfDoublePrecisionOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  graph::HgnConfig config = config_with_kernels();
  check_mixed_gradient(config, concatenate({random_graph(config, 1, 150, 0.25), random_graph(config, 2, 333, 0.4)}));
  config.levels = 5;  // the top level has no edges and few cells
  config.message_passing = 3;
  check_mixed_gradient(config, scenes_of(config, 16, 100, 0.02));  // cells with hundreds of pairs
  check_mixed_gradient(config, scenes_of(config, 64, 12, 0.02));
  config.message_passing = 1;
  check_mixed_gradient(config, scenes_of(config, 1, 12, 0.02));  // a row or two a tensor
  config.levels = 1;
  check_mixed_gradient(config, scenes_of(config, 1, 900, 0.1));
  config.bundle = 3;
  check_mixed_gradient(config, scenes_of(config, 1, 900, 0.1));
}

TEST(MixedPrecision, IsLeftToLibtorchForTheMessageFormOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  graph::HgnConfig config = config_with_kernels();
  config.aggregation = Aggregation::messages;
  configure_torch(num_threads(), /*tf32=*/false);  // a training that ran before in this process may have allowed it
  const Batch batch = concatenate({random_graph(config, 1, 150, 0.25)});
  NetworkModule exact(config, Device::cpu, 5, NumberType::f64), on_cpu(config, Device::cpu, 5, NumberType::f32);
  NetworkModule mixed(config, Device::cuda, 5, NumberType::mixed);
  EXPECT_FALSE(mixed.is_mixed());
  std::vector<double> expected, single, gradient;
  const double loss = exact.loss_and_gradient(batch, &expected);
  EXPECT_NEAR(mixed.loss_and_gradient(batch, &gradient), loss, 1e-4 * loss);
  // Rounding to f32 moves sums over the kinks of leaky ReLU: by how much, single precision on the CPU says.
  on_cpu.loss_and_gradient(batch, &single);
  expect_gradients_near(config, gradient, expected, 2e-3, relative_differences(config, single, expected));
}

TEST(MixedPrecision, IsLeftOutWhereItDoesNotExist) {
  EXPECT_FALSE(NetworkModule(tiny_config(), Device::cpu, 1, NumberType::mixed).is_mixed());
}

TEST(NetworkModule, TheSameSeedGivesTheSameWeights) {
  const graph::HgnConfig config = tiny_config();
  const ParameterLayout layout(config);
  EXPECT_EQ(layout.initial_values(7), layout.initial_values(7));
  EXPECT_NE(layout.initial_values(7), layout.initial_values(8));
  // PyTorch's default for a linear layer: uniform in +-1/sqrt(fan_in), variance 1/(3 fan_in).
  graph::HgnConfig wide;
  const ParameterLayout paper(wide);
  const std::vector<float> values = paper.initial_values(1);
  const Parameter& weight = paper.find("down.1.2.edge.layer1.weight");
  ASSERT_EQ(weight.shape, (std::vector<int64_t>{128, 384}));
  double sum2 = 0, largest = 0;
  for (int64_t i = 0; i < weight.count; ++i) {
    const double v = values[static_cast<std::size_t>(weight.begin + i)];
    sum2 += v * v;
    largest = std::max(largest, std::abs(v));
  }
  EXPECT_NEAR(sum2 / static_cast<double>(weight.count), 1.0 / (3 * 384), 0.02 / (3 * 384));
  EXPECT_LE(largest, 1 / std::sqrt(384.0));
  EXPECT_GT(largest, 0.99 / std::sqrt(384.0));
}

TEST(NetworkModule, PaperSizeNetworkHasThreeAndAHalfMillionWeights) {
  EXPECT_NEAR(static_cast<double>(ParameterLayout(graph::HgnConfig()).parameter_count()), 3.5e6, 0.05e6);
}

TEST(NetworkModule, StateGoesThroughWeightsUnchanged) {
  const graph::HgnConfig config = tiny_config();
  NetworkModule a(config, Device::cpu, 1), b(config, Device::cpu, 2);
  const Batch batch = concatenate({random_graph(config, 7, 30, 0.1)});
  a.train_step(batch, {.learning_rate = 1e-3, .ema_decay = 0.5, .step = 1});
  for (const StateArray array : all_state_arrays) b.set_state(array, a.state(array));
  EXPECT_EQ(a.predict(batch, StateArray::weights), b.predict(batch, StateArray::weights));
  EXPECT_EQ(a.predict(batch, StateArray::ema), b.predict(batch, StateArray::ema));
  EXPECT_NE(a.predict(batch, StateArray::ema), b.predict(batch, StateArray::weights));
}

TEST(NetworkModule, OneAdamStepMovesEveryUsedWeightByTheLearningRate) {
  // Adam's first step is -rate * g / (|g| + eps): the rate itself wherever the gradient is not tiny.
  const graph::HgnConfig config = tiny_config();
  NetworkModule module(config, Device::cpu, 1, NumberType::f64);
  const Batch batch = concatenate({random_graph(config, 8, 30, 0.1)});
  std::vector<double> gradient;
  module.loss_and_gradient(batch, &gradient);
  const ParameterLayout layout(config);
  const std::vector<float> before = layout.from_weights(module.state(StateArray::weights));
  module.train_step(batch, {.learning_rate = 1e-2, .clip_norm = 1e9, .step = 1});
  const std::vector<float> after = layout.from_weights(module.state(StateArray::weights));
  int checked = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    if (std::abs(gradient[i]) < 1e-4) continue;
    EXPECT_NEAR(after[i] - before[i], gradient[i] > 0 ? -1e-2 : 1e-2, 1e-5);
    ++checked;
  }
  EXPECT_GT(checked, 500);
}

TEST(NetworkModule, ANonFiniteTargetChangesNoWeight) {
  const graph::HgnConfig config = tiny_config();
  NetworkModule module(config, Device::cpu, 1);
  SceneGraph scene = random_graph(config, 9, 20, 0.1);
  scene.target[4] = std::nanf("");
  const nn::Weights before = module.state(StateArray::weights);
  module.train_step(concatenate({scene}), {.step = 1});
  EXPECT_TRUE(std::isnan(module.take_means().loss));
  EXPECT_EQ(before.get("decoder.layer2.bias", {3}), module.state(StateArray::weights).get("decoder.layer2.bias", {3}));
}

}  // namespace
}  // namespace graupel::train
