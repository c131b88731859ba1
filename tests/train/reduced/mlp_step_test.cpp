// A step of the networks' training: Adam from numbers in the device's memory; on a GPU, replayed steps lead to the
// weights that the same steps lead to one kernel at a time, whatever changes between them.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/gpu_only.h"
#include "tests/train/reduced/mlp_data.h"
#include "train/networks/graph_kernels.h"
#include "train/reduced/mlp/mlp_batches.h"

namespace graupel::train {
namespace {

TEST(AdamStep, ReadsWhatChangesFromMemory) {
  const std::vector<float> gradient = noise(300, 1);
  const float norm = 1;
  std::vector<float> by_value[4], from_memory[4];
  for (int i = 0; i < 4; ++i) by_value[i] = from_memory[i] = noise(300, 10 + static_cast<uint64_t>(i));
  for (auto& arrays : {by_value, from_memory})
    for (float& v : arrays[2]) v = std::abs(v);
  AdamSettings settings;
  settings.ema_decay = 0.9;
  settings.learning_rate = 3e-4;
  settings.correction1 = 0.3;
  settings.correction2 = 0.02;
  const auto step = [&](std::vector<float>* a) {
    adam_step<float>(Device::cpu, 300, settings, gradient.data(), &norm, a[0].data(), a[1].data(), a[2].data(),
                     a[3].data());
  };
  step(by_value);
  const double scheduled[] = {settings.learning_rate, settings.correction1, settings.correction2};
  settings.learning_rate = settings.correction1 = settings.correction2 = 77;
  settings.scheduled = scheduled;
  step(from_memory);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(by_value[i], from_memory[i]) << i;
  EXPECT_NE(by_value[0], noise(300, 10));
}

/// Over the biggest number of the array.
double difference(const MlpModule& a, const MlpModule& b, MlpArray array) {
  const nn::Weights left = a.state(array), right = b.state(array);
  double worst = 0, size = 0;
  for (const auto& [name, tensor] : left.tensors) {
    const std::vector<float> x = tensor.as_float(), y = right.tensors.at(name).as_float();
    for (std::size_t i = 0; i < x.size(); ++i) {
      worst = std::max(worst, static_cast<double>(std::abs(x[i] - y[i])));
      size = std::max(size, static_cast<double>(std::abs(x[i])));
    }
  }
  return worst / size;
}

void expect_equal(const MlpModule& a, const MlpModule& b, double tolerance) {
  for (const MlpArray array : all_mlp_arrays) EXPECT_LT(difference(a, b, array), tolerance) << name_of(array);
}

/// Steps [first, last) with batches and learning rates of their own.
void train(MlpModule& module, int64_t first, int64_t last, int64_t batch_snapshots = 3, int64_t batch_points = 40) {
  MlpBatches batches(1, 0, mlp_snapshots, mlp_points, batch_snapshots, batch_points);
  for (int64_t step = first; step < last; ++step)
    module.train_step(batches.batch(step), 1e-2 / static_cast<double>(1 + step), step + 1);
}

/// The first step of Adam moves every weight by the learning rate, whatever the size of its gradient g:
/// m / (1 - beta1) = g and v / (1 - beta2) = g^2.
TEST(MlpStep, FirstMovesEveryWeightByTheLearningRate) {
  MlpModule module = module_of({4, 1, 20, 6}, NumberType::f64);
  const nn::Weights before = module.state(MlpArray::weights);
  const MlpBatch batch{{0, 3, 4}, {5, 6, 66, 5}};
  nn::Weights gradient;
  const double loss = module.loss_and_gradient(batch, &gradient), rate = 1e-2;
  module.train_step(batch, rate, 1);
  EXPECT_DOUBLE_EQ(module.take_loss(), loss);
  const nn::Weights after = module.state(MlpArray::weights);
  for (const auto& [name, tensor] : before.tensors) {
    const std::vector<float> w0 = tensor.as_float(), w1 = after.tensors.at(name).as_float(),
                             g = gradient.tensors.at(name).as_float();
    for (std::size_t i = 0; i < w0.size(); ++i)
      EXPECT_NEAR(w1[i] - w0[i], -rate * g[i] / (std::abs(g[i]) + 1e-8), 1e-6) << name << " " << i;
  }
}

TEST(MlpStep, IsTheSameHoweverItIsLaunched) {
  const MlpShape shape{6, 1, 30, 6};
  MlpModule eager = module_of(shape, NumberType::f32, Device::cpu, StepLaunch::eager),
            graph = module_of(shape, NumberType::f32, Device::cpu, StepLaunch::graph);
  for (MlpModule* module : {&eager, &graph}) {
    train(*module, 0, 10);
    train(*module, 10, 20, 2, 10);
  }
  EXPECT_EQ(graph.replayed_steps(), 0);
  EXPECT_EQ(difference(graph, eager, MlpArray::weights), 0);
  EXPECT_GT(difference(graph, module_of(shape, NumberType::f32), MlpArray::weights), 5e-3);
}

constexpr MlpShape with_tangents{.latents = 4, .width = 30, .outputs = 3, .tangents = true};
constexpr int64_t steps = 20, replayed = steps - CapturedStep::warm_up_runs;

#define GRAUPEL_NEEDS_TRAINING_GPU() \
  GRAUPEL_NEEDS_GPU();               \
  if (!torch_has_cuda()) GTEST_SKIP() << "libtorch has no CUDA: its path was neither compiled nor run"

void expect_replay_equals_eager(const MlpShape& shape, NumberType number, double tolerance) {
  MlpModule eager = module_of(shape, number, Device::cuda, StepLaunch::eager),
            graph = module_of(shape, number, Device::cuda, StepLaunch::graph);
  train(eager, 0, steps);
  train(graph, 0, steps);
  EXPECT_EQ(eager.replayed_steps(), 0);
  EXPECT_EQ(graph.replayed_steps(), replayed);
  expect_equal(graph, eager, tolerance);
  EXPECT_GT(difference(graph, module_of(shape, number), MlpArray::weights), 5e-3);
  const double loss = eager.take_loss();
  EXPECT_NEAR(graph.take_loss(), loss, tolerance * loss);
}

TEST(MlpStepCuda, ReplayedStepsGiveTheWeightsOfEagerOnes) {
  GRAUPEL_NEEDS_TRAINING_GPU();
  for (const MlpShape& shape :
       {MlpShape{6, 0, 144, 3}, MlpShape{6, 1, 192, 6}, MlpShape{4, 0, 12, 3, 1000}, with_tangents}) {
    expect_replay_equals_eager(shape, NumberType::f64, 1e-6);  // the arrays are read as f32
    expect_replay_equals_eager(shape, NumberType::f32, 1e-4);
  }
}

TEST(MlpStepCuda, EqualsTheCpus) {
  GRAUPEL_NEEDS_TRAINING_GPU();
  for (const MlpShape& shape : {MlpShape{6, 1, 30, 6}, MlpShape{4, 0, 12, 3, 1000}, with_tangents}) {
    MlpModule cpu = module_of(shape, NumberType::f64), cuda = module_of(shape, NumberType::f64, Device::cuda);
    train(cpu, 0, steps);
    train(cuda, 0, steps);
    EXPECT_EQ(cpu.replayed_steps(), 0);
    EXPECT_EQ(cuda.replayed_steps(), replayed);
    expect_equal(cuda, cpu, 1e-6);
  }
}

TEST(MlpStepCuda, TargetsInTheHostsMemoryAreReplayedToo) {
  GRAUPEL_NEEDS_TRAINING_GPU();
  const MlpShape shape{6, 1, 30, 6};
  MlpModule near = module_of(shape, NumberType::f64, Device::cuda),
            far = module_of(shape, NumberType::f64, Device::cuda, StepLaunch::graph, 0);
  train(near, 0, steps);
  train(far, 0, steps);
  EXPECT_EQ(far.replayed_steps(), replayed);
  expect_equal(far, near, 1e-6);
}

/// Other sizes, other data and other weights between steps: none of the old recording may be left.
TEST(MlpStepCuda, WhatChangesBetweenStepsIsRecordedAnew) {
  GRAUPEL_NEEDS_TRAINING_GPU();
  const MlpShape shape{6, 1, 30, 6};
  MlpModule eager = module_of(shape, NumberType::f64, Device::cuda, StepLaunch::eager),
            graph = module_of(shape, NumberType::f64, Device::cuda, StepLaunch::graph);
  for (MlpModule* module : {&eager, &graph}) {
    const nn::Weights start = module->state(MlpArray::weights);
    train(*module, 0, 6);
    train(*module, 6, 12, 2, 10);
    module->set_states(noise(static_cast<std::size_t>(mlp_snapshots * 7), 20));
    train(*module, 12, 18, 2, 10);
    module->set_targets(noise(static_cast<std::size_t>(mlp_snapshots * mlp_points * 6), 21), 0);
    train(*module, 18, 24, 2, 10);
    module->set_state(MlpArray::weights, start);  // in place: no other recording
    train(*module, 24, 30, 2, 10);
  }
  EXPECT_EQ(graph.replayed_steps(), 30 - 4 * CapturedStep::warm_up_runs);
  expect_equal(graph, eager, 1e-6);
}

}  // namespace
}  // namespace graupel::train
