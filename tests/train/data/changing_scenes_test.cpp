// Training on scenes that change: it sees what rollouts see, makes the same batches on a device, and does not count
// particles that are not in the run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/parallel/buffer.h"
#include "core/scene/particle_rows.h"
#include "core/system/error.h"
#include "graph/features/particle_lifecycle.h"
#include "tests/gpu_only.h"
#include "tests/train/data/changing_data.h"
#include "tests/train/gns_cloud.h"
#include "train/data/device_samples.h"
#include "train/data/sampling.h"
#include "train/loop/evaluation.h"
#include "train/loop/training_loop.h"

namespace graupel::train {
namespace {

using testing::HasSubstr;

TrainConfig seeing_contact(TrainConfig config = tiny_config()) {
  config.hgn.history = config.gns.history = 4;
  config.hgn.signed_distance = config.hgn.contact = config.hgn.cell_normal = true;
  config.gns.contact = config.gns.cell_normal = true;
  config.hgn.material_constants = config.gns.material_constants = true;
  config.noise_std = 0;
  config.seed = 5;
  return config;
}

DataSplit open_split(const std::string& name) {
  DataSplitOptions options;
  options.materials = true;
  return DataSplit(changing_data_set() + "/" + name, options);
}

/// Particles in the run and their history up to a frame, as a rollout keeps them when its predictions are true.
struct TrueRollout {
  TrueRollout(const DataSplit& split, int number, int64_t frame, int64_t length)
      : info(split.trajectory(number)),
        surroundings(info.context->environment),
        history(split.history(number, 0, length)) {
    const Scene& scene = info.context->scene;
    graph::ParticleLifecycle lifecycle(scene, &info.schedule, history.back(), {}, 0);
    for (int64_t t = 1; t <= frame; ++t) {
      const double time = static_cast<double>(t) * scene.frame_time;
      const std::vector<Vec3f> truth = split.positions(number, t, 1).front();
      std::vector<Vec3f> next = history.back();
      for (std::size_t p = 0; p < next.size(); ++p)
        if (!lifecycle.changes() || lifecycle.active()[p]) next[p] = truth[p];
      history.erase(history.begin());
      history.push_back(next);
      lifecycle.leave(surroundings.at(time), {}, history);
      lifecycle.appear(surroundings.at(time), history, time);
    }
    present = lifecycle.changes() ? lifecycle.present() : info.present(frame);
    history = frame_rows(history, present);
  }

  const TrajectoryInfo& info;
  graph::MovingEnvironment surroundings;
  std::vector<std::vector<Vec3f>> history;
  std::vector<int32_t> present;
};

/// Features of batches are those that a rollout makes of the same frame, bit for bit.
void expect_features_of_rollouts(const std::string& data, const TrainConfig& config) {
  const DataSplit split = open_split(data);
  const graph::Normalization normalization = split.statistics(1e-4, 1);
  const graph::FeatureConfig& features = config.features();
  for (int64_t step = 0; step < 4; ++step) {
    const Batch batch = training_batch(split, config, normalization, step);
    const float* row = batch.numbers.data() + batch.features.begin;
    for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
      const SampleDraw draw = draw_training_sample(split, config, step, slot);
      TrueRollout rollout(split, draw.key.trajectory, draw.key.frame, features.history);
      const double next = static_cast<double>(draw.key.frame + 1) * rollout.info.context->scene.frame_time;
      const std::vector<float> expected =
          graph::particle_features(features, normalization, rollout.surroundings.at(next), rollout.history,
                                   particle_rows(rollout.info.material, rollout.present), draw.symmetry);
      ASSERT_GT(expected.size(), 0u);
      ASSERT_LE(row + expected.size(), batch.numbers.data() + batch.features.begin + batch.features.count);
      ASSERT_TRUE(std::equal(expected.begin(), expected.end(), row)) << data << " step " << step << " slot " << slot;
      row += expected.size();
    }
    EXPECT_EQ(row, batch.numbers.data() + batch.features.begin + batch.features.count);
  }
}

TEST(ChangingScenes, BatchesSeeMovingObstaclesAsRolloutsDo) {
  for (TrainConfig config : {seeing_contact(), seeing_contact(tiny_gns_config())}) {
    expect_features_of_rollouts("box.h5", config);
    config.symmetries = true;
    expect_features_of_rollouts("box.h5", config);
  }
}

TEST(ChangingScenes, BatchesSeeEmittedParticlesAsRolloutsDo) {
  for (const TrainConfig& config : {seeing_contact(), seeing_contact(tiny_gns_config())})
    expect_features_of_rollouts("stream.h5", config);
}

/// The box moves: what is near it sees its velocity, its distance and its normals change from frame to frame.
TEST(ChangingScenes, FeaturesFollowTheObstacle) {
  const DataSplit split = open_split("box.h5");
  const TrainConfig config = seeing_contact();
  const TrajectoryInfo& info = split.trajectory(0);
  const std::vector<std::vector<Vec3f>> still(5, {{0.42f, 0.36f, 0.5f}});
  graph::MovingEnvironment surroundings(info.context->environment);
  const auto row = [&](int64_t frame) {
    return graph::particle_features(config.features(), {}, surroundings.at(info.context->time_of(frame)), still, {0});
  };
  const std::vector<float> first = row(1), later = row(4);
  const std::size_t distance = 3 * 4 + 3 + 6, velocity = first.size() - 3;
  EXPECT_GT(first[distance], later[distance]) << "the box comes nearer";
  EXPECT_GT(std::abs(first[velocity]), 1e-3);
  double normal = 0;
  for (std::size_t d = 0; d < 3; ++d) normal = std::max(normal, std::abs(double(first[12 + d] - later[12 + d])));
  EXPECT_GT(normal, 1e-2) << "the box turns, with its cells";
}

std::vector<float> floats_of(Device device, const float* data, int64_t count) {
  std::vector<float> values(static_cast<std::size_t>(count));
  if (count > 0) device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(float));
  return values;
}

void expect_near(const std::vector<float>& actual, const float* expected, double tolerance) {
  for (std::size_t i = 0; i < actual.size(); ++i)
    ASSERT_NEAR(actual[i], expected[i], tolerance * (1 + std::abs(expected[i]))) << "number " << i;
}

/// Batches of all kinds of scenes, with noise, made on a device.
void expect_the_batches_of_the_workers(TrainConfig config, Device device, double tolerance, int64_t bundle) {
  config.noise_std = 1e-3;
  config.symmetries = true;
  config.hgn.bundle = config.gns.bundle = bundle;
  const DataSplit split = open_split("train.h5");
  const graph::Normalization normalization = split.statistics(1e-4, 1);
  DeviceSamples samples(split, config, normalization, device);
  samples.start(0);
  int64_t uncounted = 0;
  for (int64_t step = 0; step < 8; ++step) {
    const SampleArrays made = samples.take();
    samples.start(step + 1);
    const Batch batch = training_batch(split, config, normalization, step);
    ASSERT_EQ(made.particles, batch.particles());
    ASSERT_EQ(made.rows, batch.type_row.count);
    ASSERT_EQ(made.uncounted, batch.uncounted);
    const auto part = [&](const Part& p) { return batch.numbers.data() + p.begin; };
    expect_near(floats_of(device, made.features, batch.features.count), part(batch.features), tolerance);
    expect_near(floats_of(device, made.target, batch.target.count), part(batch.target), tolerance);
    expect_near(floats_of(device, made.counted, batch.counted.count), part(batch.counted), 0);
    std::vector<int32_t> type(static_cast<std::size_t>(made.rows));
    device_copy(Device::cpu, type.data(), device, made.type_row, type.size() * sizeof(int32_t));
    EXPECT_TRUE(std::equal(type.begin(), type.end(), batch.indices.begin() + batch.type_row.begin));
    uncounted += batch.uncounted;
    samples.release();
  }
  EXPECT_GT(uncounted, 0) << "some leave within the bundle";
}

TEST(ChangingScenes, BatchesMadeOnADeviceAreTheSame) {
  for (const TrainConfig& config : {seeing_contact(), seeing_contact(tiny_gns_config())})
    for (const int64_t bundle : {1, 3}) expect_the_batches_of_the_workers(config, Device::cpu, 0, bundle);
}

TEST(ChangingScenes, BatchesMadeOnAGpuAreTheSame) {
  GRAUPEL_NEEDS_GPU();
  for (const TrainConfig& config : {seeing_contact(), seeing_contact(tiny_gns_config())})
    for (const int64_t bundle : {1, 3}) expect_the_batches_of_the_workers(config, Device::cuda, 2e-5, bundle);
}

/// The network's own frames are those of scenes at rest alone.
void expect_pushes_to_keep_what_changes(Device device) {
  TrainConfig config = seeing_contact();
  config.push_steps = 1;
  config.push_share = 1;
  config.batch_scenes = 6;
  const DataSplit split = open_split("train.h5");
  DeviceSamples samples(split, config, {}, device);
  samples.start(0);
  const SampleArrays before = samples.take();
  const std::vector<float> features = floats_of(device, before.features, before.particles * before.feature_width),
                           target = floats_of(device, before.target, before.particles * 3);
  Buffer<float> still(device, static_cast<std::size_t>(3 * before.particles));
  still.fill_zero();
  const SampleArrays after = samples.push(still.data(), {}, 1);
  ASSERT_EQ(after.particles, before.particles);
  const std::vector<float> pushed = floats_of(device, after.features, after.particles * after.feature_width),
                           pushed_target = floats_of(device, after.target, after.particles * 3);
  std::size_t row = 0;
  std::array<int, 2> seen{};  // scenes that change, and others
  const auto width = static_cast<std::size_t>(before.feature_width);
  for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
    const SampleDraw draw = draw_training_sample(split, config, 0, slot);
    const TrajectoryInfo& info = split.trajectory(draw.key.trajectory);
    const std::size_t rows = info.present(draw.key.frame).size();
    const bool is_static = draw.key.trajectory == 2;
    ++seen[is_static ? 1 : 0];
    const auto same = [&](const std::vector<float>& a, const std::vector<float>& b, std::size_t of) {
      return std::equal(a.begin() + static_cast<std::ptrdiff_t>(row * of),
                        a.begin() + static_cast<std::ptrdiff_t>((row + rows) * of),
                        b.begin() + static_cast<std::ptrdiff_t>(row * of));
    };
    EXPECT_EQ(same(features, pushed, width), !is_static) << slot;
    EXPECT_EQ(same(target, pushed_target, 3), !is_static) << slot;
    row += rows;
  }
  EXPECT_GT(seen[0], 0);
  EXPECT_GT(seen[1], 0);
}

TEST(ChangingScenes, PushesKeepTheirTrueFrames) { expect_pushes_to_keep_what_changes(Device::cpu); }

TEST(ChangingScenes, PushesKeepTheirTrueFramesOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_pushes_to_keep_what_changes(Device::cuda);
}

/// A sample holds who is in the run in its frame; who is gone in the frames of its target does not count.
TEST(ChangingScenes, SamplesHoldWhoIsInTheRun) {
  TrainConfig config = seeing_contact();
  config.hgn.bundle = 3;
  const DataSplit split = open_split("stream.h5");
  const auto active = [&](const SampleDraw& draw, std::size_t p, int64_t frame) {
    static const Trajectory truth[] = {stream_trajectory(1), stream_trajectory(2)};
    return truth[draw.key.trajectory].frames[static_cast<std::size_t>(frame)].active[p] != 0;
  };
  for (int64_t step = 0; step < 10; ++step) {
    const Batch batch = training_batch(split, config, split.statistics(1e-4, 1), step);
    std::vector<float> expected;
    for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
      const SampleDraw draw = draw_training_sample(split, config, step, slot);
      for (std::size_t p = 0; p < split.trajectory(draw.key.trajectory).type_row.size(); ++p)
        if (active(draw, p, draw.key.frame)) expected.push_back(active(draw, p, draw.key.frame + 3) ? 1.0f : 0.0f);
    }
    ASSERT_EQ(batch.particles(), static_cast<int64_t>(expected.size()));
    EXPECT_EQ(batch.uncounted, std::count(expected.begin(), expected.end(), 0.0f));
    if (batch.uncounted == 0) continue;
    ASSERT_EQ(batch.counted.count, batch.particles());
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), batch.numbers.begin() + batch.counted.begin));
  }
}

/// In flight all accelerations are gravity's: a particle that waits or is gone would add others.
TEST(ChangingScenes, StatisticsAreOfParticlesInTheRun) {
  const DataSplit split = open_split("stream.h5");
  const graph::Normalization normalization = split.statistics(0, 1);
  EXPECT_NEAR(normalization.acceleration_mean[1], -9.8 / 3600, 1e-6);
  EXPECT_LT(normalization.acceleration_std[1], 1e-6);
}

/// A network that predicts gravity: births, their pasts and departures are those of the data.
TEST(ChangingScenes, EvaluationFollowsParticlesThatComeAndGo) {
  const DataSplit split = open_split("stream.h5");
  const TrainConfig config = seeing_contact();
  graph::Normalization gravity;
  for (int d = 0; d < 3; ++d) gravity.acceleration_std[d] = 1e-9f;
  gravity.acceleration_mean[1] = -9.8f / 3600;
  const NetworkModule module(config.hgn, Device::cpu, 1);
  const OneStepErrors errors =
      evaluate_one_step(module, gravity, split, strided_samples(split, 1), {.batch_scenes = 4, .threads = 2});
  int64_t counted = 0;
  for (int i = 0; i < split.count(); ++i)
    for (int64_t t = 0; t + 1 < split.trajectory(i).frames; ++t)
      for (std::size_t p = 0; p < split.trajectory(i).type_row.size(); ++p)
        counted += split.trajectory(i).is_in_run(p, t, t + 1);
  EXPECT_EQ(errors.all().particles, counted);
  EXPECT_LT(errors.all().raw_mse(Predictor::network), 1e-13);
  EXPECT_LT(evaluate_rollout(module, gravity, split, 2, 39, {.threads = 1}), 1e-10);
}

TEST(ChangingScenes, DrawsFramesInWhichParticlesCount) {
  const DataSplit split = open_split("stream.h5");
  for (int64_t step = 0; step < 200; ++step) {
    const SampleKey key = draw_sample(split, 1, step, 0, 2, 3);
    EXPECT_TRUE(split.trajectory(key.trajectory).some_count(key.frame, key.frame + 3));
    EXPECT_LT(key.frame, 37);
  }
  for (const SampleKey& key : strided_samples(split, 1))
    EXPECT_TRUE(split.trajectory(key.trajectory).some_count(key.frame, key.frame + 1));
}

std::string refusal(const Trajectory& trajectory) {
  const std::string folder = test_folder("refused");
  write_trajectories(folder + "/train.h5", {trajectory});
  std::string said;
  try {
    const DataSplit split(folder + "/train.h5");
    split.check_fits(tiny_gns_config().network());
    TrainConfig particles = tiny_gns_config();
    particles.gns.obstacle_particles = true;
    split.check_fits(particles.network());
  } catch (const Error& error) {
    said = error.what();
  }
  remove_path(folder);
  return said;
}

TEST(ChangingScenes, DataThatCannotBeTrainedOnAreRefusedByName) {
  EXPECT_EQ(refusal(tiny_trajectory(1, 24, 30)), "");
  EXPECT_THAT(refusal(moving_box_trajectory(1)), HasSubstr("trajectory 0 has moving obstacles, whose particles"));
  Trajectory untold = stream_trajectory(1);
  for (ParticleFrame& frame : untold.frames) frame.active.clear();
  EXPECT_THAT(refusal(untold), HasSubstr("trajectory 0 does not tell which particles are in the run"));
  Trajectory other = stream_trajectory(1);
  other.seed = 2;
  EXPECT_THAT(refusal(other), HasSubstr("trajectory 0: the emitters of its scene are of other particles"));
  Trajectory back = stream_trajectory(1);
  back.frames[3].active[0] = 0;
  EXPECT_THAT(refusal(back), HasSubstr("trajectory 0 has particle 0 in the run again in frame 4"));
  Trajectory unknown = tiny_trajectory(1, 24, 30);
  unknown.particle_type[3] = 12;
  EXPECT_THAT(refusal(unknown), HasSubstr("trajectory 0: a particle type is not known to the network (12"));
}

/// A stream whose particles are all gone from frame `end` on.
Trajectory stream_until(int64_t end) {
  Trajectory trajectory = stream_trajectory(1);
  for (std::size_t t = 0; t < trajectory.frames.size(); ++t)
    for (uint8_t& active : trajectory.frames[t].active) active = active && static_cast<int64_t>(t) < end;
  return trajectory;
}

TEST(ChangingScenes, TrajectoriesWithoutSamplesAreRefusedBeforePositionsAreRead) {
  const std::string folder = test_folder("no_samples");
  write_trajectories(folder + "/train.h5", {stream_trajectory(2), stream_until(2)});
  const auto refused = [&](int64_t bundle, int64_t push_steps) {
    bool read = false;
    std::string said;
    DataSplitOptions options;
    options.check = [&](const DataSplit& split) { split.check_samples(bundle, push_steps); };
    options.progress = [&](const std::string& what, int64_t, int64_t) { read = read || what == "positions"; };
    try {
      const DataSplit split(folder + "/train.h5", options);
    } catch (const Error& error) {
      said = error.what();
    }
    EXPECT_EQ(read, said.empty()) << said;
    return said;
  };
  EXPECT_EQ(refused(1, 0), "");
  EXPECT_THAT(
      refused(3, 0),
      HasSubstr("train.h5': trajectory 1 has no particle that moves by itself and is in the run for 4 frames (of "
                "0 to 39). Leave it out, or generate longer runs"));
  EXPECT_THAT(refused(4, 9), HasSubstr("train.h5': trajectory 0 is too short for training (40 usable frames, needed 41 "
                                       "for bundle 4 and push_steps 9). Lower these, or generate longer runs"));
  remove_path(folder);
}

/// Training draws none of the bad ones in its only step.
TEST(ChangingScenes, TrainingRefusesTrajectoriesThatItWouldNotDraw) {
  const std::string folder = test_folder("not_drawn");
  write_trajectories(folder + "/train.h5", {stream_trajectory(1), stream_trajectory(2), stream_until(2)});
  write_trajectories(folder + "/valid.h5", {stream_until(1)});
  TrainingOptions options;
  options.data = folder;
  options.run = folder + "/run";
  options.config = seeing_contact();
  options.config.batch_scenes = options.config.steps = 1;
  options.config.hgn.bundle = 2;
  options.version = "test";
  const auto refusal_of = [&] {
    try {
      train_network(options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal_of(), HasSubstr("train.h5': trajectory 2 has no particle"));
  EXPECT_FALSE(std::filesystem::exists(options.run));
  options.config.hgn.bundle = 1;
  EXPECT_THAT(refusal_of(), HasSubstr("valid.h5': trajectory 0 has no particle"));
  remove_path(folder);
}

}  // namespace
}  // namespace graupel::train
