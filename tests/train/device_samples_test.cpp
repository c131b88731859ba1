// Batches made on a device are those that the CPU's threads make.
#include "train/device_samples.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/buffer.h"
#include "tests/gpu_only.h"
#include "tests/train/tiny_data.h"
#include "train/hgn_module.h"
#include "train/sampling.h"

namespace graupel::train {
namespace {

TrainConfig sample_config() {
  TrainConfig config = tiny_config();
  config.hgn.history = 5;  // reaches before the first frame
  config.symmetries = true;
  config.seed = 7;
  return config;
}

std::vector<float> floats_of(Device device, const float* data, int64_t count) {
  std::vector<float> values(static_cast<std::size_t>(count));
  device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(float));
  return values;
}

void expect_near(const std::vector<float>& actual, const float* expected, int64_t count, double tolerance) {
  ASSERT_EQ(static_cast<int64_t>(actual.size()), count);
  for (std::size_t i = 0; i < actual.size(); ++i)
    ASSERT_NEAR(actual[i], expected[i], tolerance * (1 + std::abs(expected[i]))) << "number " << i;
}

void expect_the_batches_of_the_cpu(Device device, double tolerance, BatchShare share = {}) {
  const TrainConfig config = sample_config();
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  DeviceSamples samples(split, config, normalization, device, share);
  samples.start(0);
  for (int64_t step = 0; step < 6; ++step) {
    const SampleArrays made = samples.take();
    samples.start(step + 1);
    const Batch batch = training_batch(split, config, normalization, step, share);
    ASSERT_EQ(made.particles, batch.particles());
    ASSERT_EQ(made.feature_width, batch.feature_width);
    const auto part = [&](const Part& p) { return batch.numbers.data() + p.begin; };
    expect_near(floats_of(device, made.features, batch.features.count), part(batch.features), batch.features.count,
                tolerance);
    expect_near(floats_of(device, made.target, batch.target.count), part(batch.target), batch.target.count, tolerance);
    ASSERT_EQ(made.counts.levels, static_cast<int>(batch.level.size()));
    for (std::size_t l = 0; l < batch.level.size(); ++l) {
      ASSERT_EQ(made.counts.cells[l], batch.level[l].cells);
      ASSERT_EQ(made.counts.edges[l], batch.level[l].edges);
    }
    samples.release();
  }
}

TEST(DeviceSamples, AreTheBatchesOfTheWorkers) {
  expect_the_batches_of_the_cpu(Device::cpu, 0);
  expect_the_batches_of_the_cpu(Device::cpu, 0, {1, 3});  // of the second of three ranks
}

TEST(DeviceSamples, AreTheBatchesOfTheWorkersOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_the_batches_of_the_cpu(Device::cuda, 2e-5);
}

/// Weights after three steps.
std::vector<float> trained(Device device, bool on_device) {
  const TrainConfig config = sample_config();
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  HgnModule module(config.hgn, device, config.seed);
  std::unique_ptr<DeviceSamples> samples;
  if (on_device) {
    samples = std::make_unique<DeviceSamples>(split, config, normalization, device);
    samples->start(0);
  }
  for (int64_t step = 0; step < 3; ++step) {
    StepSettings settings;
    settings.learning_rate = 1e-2;
    settings.step = step + 1;
    if (on_device) {
      const SampleArrays batch = samples->take();
      samples->start(step + 1);
      module.train_step(batch, settings);
      samples->release();
    } else {
      module.train_step(training_batch(split, config, normalization, step), settings);
    }
  }
  const nn::Weights weights = module.state(StateArray::weights);
  std::vector<float> all;
  for (const auto& [name, tensor] : weights.tensors) {
    const std::vector<float> values = tensor.as_float();
    all.insert(all.end(), values.begin(), values.end());
  }
  return all;
}

TEST(DeviceSamples, TrainTheSameWeights) { EXPECT_EQ(trained(Device::cpu, true), trained(Device::cpu, false)); }

TEST(DeviceSamples, TrainTheSameWeightsOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const std::vector<float> expected = trained(Device::cuda, false);
  expect_near(trained(Device::cuda, true), expected.data(), static_cast<int64_t>(expected.size()), 2e-3);
}

}  // namespace
}  // namespace graupel::train
