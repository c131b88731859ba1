// Batches made on a device are those that the CPU's threads make.
#include "train/data/device_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/parallel/buffer.h"
#include "tests/gpu_only.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/tiny_data.h"
#include "train/data/sampling.h"
#include "train/networks/network_module.h"

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

void expect_the_batches_of_the_cpu(Device device, double tolerance, BatchShard shard = {}, int64_t bundle = 1) {
  TrainConfig config = sample_config();
  config.hgn.bundle = bundle;
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  DeviceSamples samples(split, config, normalization, device, shard);
  samples.start(0);
  for (int64_t step = 0; step < 6; ++step) {
    const SampleArrays made = samples.take();
    samples.start(step + 1);
    const Batch batch = training_batch(split, config, normalization, step, shard);
    ASSERT_EQ(made.particles, batch.particles());
    ASSERT_EQ(made.feature_width, batch.feature_width);
    ASSERT_EQ(made.target_width, 3 * bundle);
    ASSERT_EQ(made.target_width, batch.target_width);
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
  expect_the_batches_of_the_cpu(Device::cpu, 0, {}, 3);
}

TEST(DeviceSamples, AreTheBatchesOfTheWorkersOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_the_batches_of_the_cpu(Device::cuda, 2e-5);
  expect_the_batches_of_the_cpu(Device::cuda, 2e-5, {}, 3);
}

/// Batches of GNS with obstacle particles, edges and all.
void expect_the_batches_of_gns(Device device, double tolerance, bool obstacle_particles) {
  TrainConfig config = tiny_gns_config();
  config.gns.history = 5;
  config.symmetries = true;
  config.seed = 7;
  config.gns.obstacle_particles = obstacle_particles;
  config.gns.obstacle_spacing = 0.02;
  config.gns.message_passing = 3;
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  DeviceSamples samples(split, config, normalization, device);
  samples.start(0);
  int64_t with_obstacles = 0;
  for (int64_t step = 0; step < 6; ++step) {
    const SampleArrays made = samples.take();
    samples.start(step + 1);
    const Batch batch = training_batch(split, config, normalization, step);
    const BatchLevel& links = batch.level.front();
    ASSERT_EQ(made.particles, batch.particles());
    ASSERT_EQ(made.rows, batch.type_row.count);
    ASSERT_EQ(made.pair_count, links.edges);
    const auto numbers = [&](const Part& p) { return batch.numbers.data() + p.begin; };
    const auto expect_indices = [&](const int32_t* data, const Part& part) {
      std::vector<int32_t> values(static_cast<std::size_t>(part.count));
      device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(int32_t));
      EXPECT_TRUE(std::equal(values.begin(), values.end(), batch.indices.begin() + part.begin));
    };
    expect_near(floats_of(device, made.features, batch.features.count), numbers(batch.features), batch.features.count,
                tolerance);
    expect_near(floats_of(device, made.target, batch.target.count), numbers(batch.target), batch.target.count,
                tolerance);
    expect_near(floats_of(device, made.pairs.features, batch.edge_features.count), numbers(batch.edge_features),
                batch.edge_features.count, tolerance);
    expect_indices(made.type_row, batch.type_row);
    expect_indices(made.pairs.begin, links.edge_begin);
    expect_indices(made.pairs.sender, links.sender);
    expect_indices(made.pairs.receiver, links.receiver);
    expect_indices(made.pairs.reverse, links.reverse);
    with_obstacles += made.rows > made.particles;
    samples.release();
  }
  EXPECT_EQ(with_obstacles > 0, obstacle_particles);
}

TEST(DeviceSamples, AreTheBatchesOfTheWorkersForGns) {
  expect_the_batches_of_gns(Device::cpu, 0, false);
  expect_the_batches_of_gns(Device::cpu, 0, true);
}

TEST(DeviceSamples, AreTheBatchesOfTheWorkersForGnsOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_the_batches_of_gns(Device::cuda, 2e-5, false);
  expect_the_batches_of_gns(Device::cuda, 2e-5, true);
}

/// What the network sees and is to predict after frames of its own, for outputs of zero: free motion.
void expect_pushed_batches(Device device, int64_t bundle) {
  TrainConfig config = sample_config();
  config.hgn.bundle = bundle;
  config.noise_std = 0;
  config.push_steps = 2;
  config.push_recovery = 0.25;
  config.push_velocity_recovery = 0.75;
  config.batch_scenes = 2;
  const DataSplit split(tiny_data_set() + "/train.h5");
  DeviceSamples samples(split, config, {}, device);  // nothing is normalised
  int64_t step = 0;
  while (pushes_of(config, step) != 2) ++step;
  samples.start(step);
  SampleArrays batch = samples.take();
  Buffer<float> still(device, static_cast<std::size_t>(3 * bundle * batch.particles));
  still.fill_zero();
  for (const int64_t push : {1, 2}) batch = samples.push(still.data(), {}, push);
  const std::vector<float> features = floats_of(device, batch.features, batch.particles * batch.feature_width),
                           target = floats_of(device, batch.target, 3 * bundle * batch.particles);
  std::size_t row = 0;
  const auto width = static_cast<std::size_t>(batch.target_width);
  for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
    const SampleDraw draw = draw_training_sample(split, config, step, slot);
    const auto past = split.history(draw.key.trajectory, draw.key.frame, 1);
    // From the frame before the newest one up to those of the targets.
    const auto truth = split.positions(draw.key.trajectory, draw.key.frame + 2 * bundle - 1, bundle + 2);
    for (std::size_t p = 0; p < past[0].size(); ++p, ++row) {
      Vec3f velocity = past[1][p] - past[0][p], x = past[1][p];
      for (int64_t frame = 0; frame < 2 * bundle; ++frame) x += velocity;
      const auto acceleration = [&](std::size_t j) {
        return truth[j + 1][p] - truth[j][p] - (truth[j][p] - truth[j - 1][p]);
      };
      const Vec3f next =
          x + velocity + acceleration(1) + (truth[1][p] - truth[0][p] - velocity) * 0.75f + (truth[1][p] - x) * 0.25f;
      const Vec3f newest = draw.symmetry.apply(velocity), older = draw.symmetry.apply(velocity),
                  wanted = draw.symmetry.apply(next - x - velocity);
      for (std::size_t d = 0; d < 3; ++d) {
        const int axis = static_cast<int>(d);
        EXPECT_NEAR(features[row * static_cast<std::size_t>(batch.feature_width) + d], newest[axis], 5e-7);
        EXPECT_NEAR(features[row * static_cast<std::size_t>(batch.feature_width) + 3 + d], older[axis], 5e-7);
        EXPECT_NEAR(target[width * row + d], wanted[axis], 1e-6);
        for (std::size_t j = 2; j <= static_cast<std::size_t>(bundle); ++j)
          EXPECT_NEAR(target[width * row + 3 * (j - 1) + d], draw.symmetry.apply(acceleration(j))[axis], 5e-7);
      }
    }
  }
  EXPECT_EQ(row, static_cast<std::size_t>(batch.particles));
}

TEST(DeviceSamples, PushedBatchesHoldTheNetworksOwnFrames) {
  for (const int64_t bundle : {1, 3}) expect_pushed_batches(Device::cpu, bundle);
}

TEST(DeviceSamples, PushedBatchesHoldTheNetworksOwnFramesOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  for (const int64_t bundle : {1, 3}) expect_pushed_batches(Device::cuda, bundle);
}

/// Weights after three steps.
std::vector<float> trained(Device device, bool on_device, const TrainConfig& config = sample_config()) {
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  NetworkModule module(config.network(), device, config.seed);
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

TEST(DeviceSamples, TrainTheSameWeights) {
  EXPECT_EQ(trained(Device::cpu, true), trained(Device::cpu, false));
  TrainConfig gns = tiny_gns_config();
  gns.gns.obstacle_particles = true;
  gns.gns.obstacle_spacing = 0.03;
  EXPECT_EQ(trained(Device::cpu, true, gns), trained(Device::cpu, false, gns));
}

TEST(DeviceSamples, TrainTheSameWeightsOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  const std::vector<float> expected = trained(Device::cuda, false);
  expect_near(trained(Device::cuda, true), expected.data(), static_cast<int64_t>(expected.size()), 2e-3);
}

}  // namespace
}  // namespace graupel::train
