// Training on data of other programs: kinematic particles, and scenes with two dimensions.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"
#include "tests/gpu_only.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/tiny_data.h"
#include "train/data/device_samples.h"
#include "train/data/sampling.h"
#include "train/data/symmetry.h"
#include "train/loop/evaluation.h"
#include "train/networks/network_module.h"

namespace graupel::train {
namespace {

constexpr int kinematic_count = 10;

const char* plane_scene() {
  return R"({
    "name": "bounce", "domain": {"dimensions": 2, "size": [1, 1, 1], "dx": 0.03125, "wall_cells": 4},
    "materials": {"w": {"preset": "water"}},
    "sources": [{"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.5, 0.5, 0.5], "material": "w"}],
    "frames": 40, "frame_time": 0.016666666666666666
  })";
}

/// The tiny trajectory in the plane z = 0.5; with `with_kinematic`, behind it a row of obstacle particles that goes up
/// and down and one of stationary particles that is still.
Trajectory plane_trajectory(uint64_t seed, bool with_kinematic) {
  Trajectory trajectory = tiny_trajectory(seed, 24, 30);
  trajectory.scene_json = io::scene_to_json(io::parse_scene(plane_scene(), "plane", "."));
  for (int k = 0; with_kinematic && k < kinematic_count; ++k)
    trajectory.particle_type.push_back(k % 2 ? 13 : obstacle_particle_type);
  for (std::size_t t = 0; t < trajectory.frames.size(); ++t) {
    ParticleFrame& frame = trajectory.frames[t];
    frame.velocity.clear();
    for (Vec3f& x : frame.position) x[2] = 0.5f;
    for (int k = 0; with_kinematic && k < kinematic_count; ++k)
      frame.position.push_back({0.4f + 0.02f * static_cast<float>(k),
                                0.17f + (k % 2 ? 0 : 0.01f * std::sin(0.3f * static_cast<float>(t))), 0.5f});
  }
  return trajectory;
}

const std::string& plane_file(bool with_kinematic) {
  static const struct Files {
    Files() : folder(test_folder("plane")), file{folder + "/without.h5", folder + "/with.h5"} {
      for (const bool with : {false, true}) {
        std::vector<std::string> parts;
        for (uint64_t i = 0; i < 3; ++i) {
          const Trajectory trajectory = plane_trajectory(i, with);
          parts.push_back(file[with] + "." + std::to_string(i));
          io::TrajectoryWriter writer(parts.back(), trajectory, {.velocity = false});
          for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
          writer.finish();
        }
        io::merge_trajectories(parts, file[with]);
      }
    }
    ~Files() { remove_path(folder); }
    std::string folder, file[2];
  } files;
  return files.file[with_kinematic];
}

TrainConfig plane_config() {
  TrainConfig config = tiny_config();
  config.hgn.dimensions = 2;
  config.hgn.history = 4;
  config.symmetries = true;
  config.noise_std = 1e-3;
  config.wave_share = 0.5;
  return config;
}

/// Rows of `width` of one part of a batch.
struct Rows {
  const Batch& batch;
  Part part;
  int64_t width;
  const float* row(int64_t i) const { return batch.numbers.data() + part.begin + i * width; }
};

int32_t type_row(const Batch& batch, int64_t i) {
  return batch.indices[static_cast<std::size_t>(batch.type_row.begin + i)];
}

TEST(KinematicParticles, StatisticsAreThoseOfTheOthers) {
  const DataSplit with(plane_file(true)), without(plane_file(false));
  const graph::Normalization a = with.statistics(1e-3, 1), b = without.statistics(1e-3, 2);
  for (int d = 0; d < 3; ++d) {
    EXPECT_EQ(a.velocity_mean[d], b.velocity_mean[d]);
    EXPECT_EQ(a.velocity_std[d], b.velocity_std[d]);
    EXPECT_EQ(a.acceleration_std[d], b.acceleration_std[d]);
  }
  EXPECT_EQ(a.velocity_std[2], 1) << "nothing moves along z, noise neither";
  EXPECT_EQ(with.trajectory(0).kinematic_count(), kinematic_count);
}

/// Held particles have neither noise nor waves, whatever the others have; nothing leaves the plane.
TEST(KinematicParticles, AreInTheSamplesAsInTheData) {
  TrainConfig config = plane_config();
  config.symmetries = false;
  const DataSplit split(plane_file(true));
  const Batch noisy = training_batch(split, config, {}, 3);
  config.noise_std = config.wave_share = 0;
  const Batch clean = training_batch(split, config, {}, 3);
  const int64_t width = clean.feature_width;
  const Rows a{noisy, noisy.features, width}, b{clean, clean.features, width};
  ASSERT_EQ(noisy.particles(), 4 * (24 + kinematic_count));
  EXPECT_EQ(noisy.uncounted, 4 * kinematic_count);
  int64_t found = 0;
  for (int64_t i = 0; i < noisy.particles(); ++i) {
    const bool is_kinematic = graph::is_kinematic_row(type_row(noisy, i));
    found += is_kinematic;
    bool same = true;
    for (int64_t k = 0; k < 3 * config.hgn.history; ++k) {
      same = same && a.row(i)[k] == b.row(i)[k];
      if (k % 3 == 2) {
        EXPECT_EQ(a.row(i)[k], 0) << "a velocity along z";
      }
    }
    EXPECT_EQ(same, is_kinematic) << i;
    EXPECT_EQ((Rows{noisy, noisy.target, 3}.row(i)[2]), 0);
  }
  EXPECT_EQ(found, noisy.uncounted);
}

/// Of both architectures: the loss is the mean over the others' x and y, and its gradient knows no target of kinematic
/// particles.
void expect_the_loss_of_the_others(const TrainConfig& config) {
  const DataSplit split(plane_file(true));
  split.check_fits(config.network());
  NetworkModule module(config.network(), Device::cpu, 3, NumberType::f64);
  const graph::Normalization statistics = split.statistics(config.noise_std, 1);
  Batch batch = training_batch(split, config, statistics, 1);
  const std::vector<float> predicted = module.predict(batch, StateArray::weights);
  double sum = 0, out_of_plane = 0;
  int64_t count = 0;
  for (int64_t i = 0; i < batch.particles(); ++i) {
    if (graph::is_kinematic_row(type_row(batch, i))) continue;
    ++count;
    const float *guess = predicted.data() + 3 * i, *truth = Rows{batch, batch.target, 3}.row(i);
    sum += std::pow(guess[0] - truth[0], 2) + std::pow(guess[1] - truth[1], 2);
    out_of_plane += std::abs(guess[2]);
  }
  ASSERT_GT(out_of_plane, 0);
  EXPECT_EQ(count, batch.particles() - batch.uncounted);
  std::vector<double> gradient, other;
  EXPECT_NEAR(module.loss_and_gradient(batch, &gradient), sum / static_cast<double>(count), 1e-5 * sum);
  for (int64_t i = 0; i < batch.particles(); ++i)
    if (graph::is_kinematic_row(type_row(batch, i)))
      batch.numbers[static_cast<std::size_t>(batch.target.begin + 3 * i)] += 100;
  module.loss_and_gradient(batch, &other);
  EXPECT_EQ(gradient, other);
}

TEST(KinematicParticles, TheLossDoesNotCountThemNorZ) { expect_the_loss_of_the_others(plane_config()); }

TrainConfig plane_gns_config() {
  TrainConfig config = tiny_gns_config();
  config.gns.dimensions = 2;
  return config;
}

TEST(KinematicParticles, TheLossOfGnsDoesNotCountThemNorZ) { expect_the_loss_of_the_others(plane_gns_config()); }

/// The kernels that make batches on a device have the same rules, frames of the network's own too.
TEST(KinematicParticles, BatchesOfTheDeviceAreThoseOfTheWorkers) {
  TrainConfig config = plane_config();
  config.push_steps = 2;
  config.push_share = 1;
  const DataSplit split(plane_file(true));
  const graph::Normalization statistics = split.statistics(config.noise_std, 1);
  DeviceSamples samples(split, config, statistics, Device::cpu);
  samples.start(0);
  const SampleArrays made = samples.take();
  const Batch batch = training_batch(split, config, statistics, 0);
  ASSERT_EQ(made.particles, batch.particles());
  EXPECT_EQ(made.uncounted, batch.uncounted);
  for (int64_t i = 0; i < batch.features.count; ++i) {  // compilers choose which sums become fused multiply-adds
    const float feature = batch.numbers[static_cast<std::size_t>(batch.features.begin + i)];
    ASSERT_NEAR(made.features[i], feature, 1e-5 * (1 + std::abs(feature))) << i;
  }
  for (std::size_t l = 0; l < batch.level.size(); ++l) EXPECT_EQ(made.counts.cells[l], batch.level[l].cells);

  const std::vector<float> wild(static_cast<std::size_t>(3 * made.particles), 5.0f);
  std::vector<float> before(made.features, made.features + made.particles * made.feature_width);
  const SampleArrays pushed = samples.push(wild.data(), statistics, 1);
  for (int64_t i = 0; i < pushed.particles; ++i) {
    const float* row = pushed.features + i * pushed.feature_width;
    for (int64_t k = 2; k < 3 * config.hgn.history; k += 3) EXPECT_EQ(row[k], 0);
    if (!graph::is_kinematic_row(pushed.type_row[i])) continue;
    // The velocity before the newest one is what the newest one was; the newest one is the data's: 3 mm a frame at
    // most.
    EXPECT_EQ(row[3], before[static_cast<std::size_t>(i * pushed.feature_width)]);
    const double velocity = row[1] * statistics.velocity_std[1] + statistics.velocity_mean[1];
    EXPECT_LT(std::abs(velocity), 0.0035);
  }
}

TEST(KinematicParticles, TheLossOnTheGpuIsThatOfTheCpu) {
  GRAUPEL_NEEDS_GPU();
  const TrainConfig config = plane_config();
  const DataSplit split(plane_file(true));
  const graph::Normalization statistics = split.statistics(config.noise_std, 1);
  DeviceSamples samples(split, config, statistics, Device::cuda);
  samples.start(0);
  const SampleArrays made = samples.take();
  const Batch batch = training_batch(split, config, statistics, 0);
  EXPECT_EQ(made.uncounted, batch.uncounted);
  const NetworkModule on_gpu(config.network(), Device::cuda, 3), on_cpu(config.network(), Device::cpu, 3);
  const double loss = on_cpu.loss(batch);
  EXPECT_NEAR(on_gpu.loss(batch), loss, 1e-2 * loss);  // TF32
}

TEST(KinematicParticles, ErrorsDoNotCountThem) {
  const TrainConfig config = plane_config();
  const DataSplit split(plane_file(true));
  const graph::Normalization statistics = split.statistics(config.noise_std, 1);
  const NetworkModule module(config.network(), Device::cpu, 1);
  const auto samples = spread_samples(split, 7);
  const SquaredErrors errors = evaluate_one_step(module, statistics, split, samples, {}).all();
  EXPECT_EQ(errors.particles, 7 * 24);
  EXPECT_TRUE(std::isfinite(evaluate_rollout(module, statistics, split, 2, 5, {})));
}

TEST(KinematicParticles, ARunWithoutOthersIsRefused) {
  const std::string file = test_folder("held") + "/all.h5";
  Trajectory trajectory = plane_trajectory(1, false);
  for (int32_t& type : trajectory.particle_type) type = obstacle_particle_type;
  io::TrajectoryWriter writer(file, trajectory, {.velocity = false});
  for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
  writer.finish();
  EXPECT_THROW(DataSplit{file}, InputError);
  remove_path(std::filesystem::path(file).parent_path());
}

/// The plane lies between two layers of cells, whatever the jitter; the level above has one.
TEST(Plane, GridsHaveTwoLayersAndOneAbove) {
  const TrainConfig config = plane_config();
  const DataSplit split(plane_file(true));
  const TrajectoryInfo& trajectory = split.trajectory(0);
  for (int64_t step = 0; step < 20; ++step) {
    const SampleDraw draw = draw_training_sample(split, config, step, 0);
    EXPECT_EQ(draw.symmetry.axis[2], 2);
    EXPECT_EQ(draw.symmetry.sign[2], 1);
    EXPECT_DOUBLE_EQ(draw.origin[2], 0.5 - config.hgn.spacing);
    for (int w = 0; w < Waves::count; ++w)
      EXPECT_EQ(draw.displacement.amplitude[w] * draw.displacement.vector[w][2], 0);
  }
  const SceneGraph graph =
      scene_graph(config.network(), {}, trajectory.context->environment, {trajectory.type_row, {}},
                  split.history(0, 9, config.hgn.history), grid_origin(trajectory, config.network()));
  for (const Vec<int, 3>& cell : graph.hierarchy.levels[0].coordinate) EXPECT_TRUE(cell[2] == 0 || cell[2] == 1);
  for (const Vec<int, 3>& cell : graph.hierarchy.levels[1].coordinate) EXPECT_EQ(cell[2], 0);
  for (const auto& weight : graph.hierarchy.weight)
    for (std::size_t corner = 0; corner < 4; ++corner) EXPECT_NEAR(weight[corner], weight[corner + 4], 1e-6);
}

TEST(Plane, SymmetriesKeepIt) {
  EXPECT_EQ(symmetries_of({0, -9.8, 0}, 2).size(), 2u);  // x mirrored or not
  EXPECT_EQ(symmetries_of(Vec3d::zero(), 2).size(), 8u);
  for (const AxisMap& symmetry : symmetries_of(Vec3d::zero(), 2)) EXPECT_EQ(symmetry.apply(Vec3d{1, 2, 3})[2], 3);
}

TEST(Plane, DataAndNetworkMustHaveTheSameDimensions) {
  const DataSplit plane(plane_file(true)), space(tiny_data_set() + "/train.h5");
  try {
    plane.check_fits(tiny_config().network());
    FAIL() << "no error";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("Set hgn.dimensions"), std::string::npos) << error.what();
  }
  EXPECT_THROW(space.check_fits(plane_config().network()), ConfigError);
  EXPECT_NO_THROW(plane.check_fits(plane_config().network()));
}

}  // namespace
}  // namespace graupel::train
