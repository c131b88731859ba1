// Constants of materials and contact as inputs of training: what the data tell, batches, weights.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/system/error.h"
#include "graph/learned_simulator.h"
#include "graph/networks/graph_network.h"
#include "mpm/sampling.h"
#include "nn/trained_box.h"
#include "tests/gpu_only.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/tiny_data.h"
#include "train/data/device_samples.h"
#include "train/data/sampling.h"
#include "train/loop/training_loop.h"

namespace graupel::train {
namespace {

using ::testing::HasSubstr;

/// Two jellies beside each other above a rough floor, beside a sphere that sticks; in two dimensions all in the plane.
std::string jelly_scene(const std::string& materials, int dimensions = 3) {
  const std::string z = dimensions == 2 ? "0.5" : "0.35", z_of_sphere = dimensions == 2 ? "0.5" : "0.22";
  return R"({
    "name": "jellies",
    "domain": {"dimensions": )" +
         std::to_string(dimensions) +
         R"(, "size": [1, 1, 1], "dx": 0.03125, "wall_cells": 4, "faces": {"y_low": {"kind": "slip", "friction": 0.4}}},
    "materials": )" +
         materials + R"(,
    "sources": [
      {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.35, 0.35, )" +
         z + R"(], "particles_per_cell": 1, "material": "b"},
      {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.6, 0.35, )" +
         z + R"(], "particles_per_cell": 1, "material": "a"}],
    "obstacles": [{"shape": "sphere", "radius": 0.1, "position": [0.22, 0.35, )" +
         z_of_sphere + R"(], "contact": "stick"}],
    "frames": 20, "frame_time": 0.016666666666666666
  })";
}
const char* soft_and_hard =
    R"({"a": {"preset": "jelly", "youngs_modulus": 3e4}, "b": {"preset": "jelly", "youngs_modulus": 9e5}})";

/// The scene's particles, which fly freely.
Trajectory flight(const Scene& scene, uint64_t seed) {
  const mpm::SampledParticles particles = mpm::sample_sources(scene, seed);
  Trajectory trajectory;
  trajectory.scene_json = io::scene_to_json(scene);
  trajectory.seed = seed;
  trajectory.made_by = "mpm";
  trajectory.particle_type.assign(particles.position.size(), particle_type_of(MaterialModel::jelly));
  for (int t = 0; t < 20; ++t) {
    ParticleFrame frame;
    frame.time = t / 60.0;
    const double sideways = scene.domain.is_plane() ? 0 : 0.1;
    const Vec3d way = {0.3 * frame.time, 0.5 * frame.time - 4.9 * frame.time * frame.time, sideways * frame.time};
    for (const Vec3d& x : particles.position) {
      frame.position.push_back((x + way).cast<float>());
      frame.velocity.push_back({0.3f, 0.5f, static_cast<float>(sideways)});
    }
    trajectory.frames.push_back(std::move(frame));
  }
  return trajectory;
}

void write(const std::string& file, const std::vector<Trajectory>& trajectories) {
  std::vector<std::string> parts;
  for (const Trajectory& trajectory : trajectories) {
    parts.push_back(file + "." + std::to_string(parts.size()));
    io::TrajectoryWriter writer(parts.back(), trajectory, {.velocity = false});
    for (const ParticleFrame& frame : trajectory.frames) writer.append(frame);
    writer.finish();
  }
  io::merge_trajectories(parts, file);
  for (const std::string& part : parts) std::filesystem::remove(part);
}

const std::string& jelly_data() {
  static const struct Data {
    Data() : folder(test_folder("jellies")) {
      const Scene scene = io::parse_scene(jelly_scene(soft_and_hard), "jellies", ".");
      write(folder + "/train.h5", {flight(scene, 1), flight(scene, 2)});
      write(folder + "/valid.h5", {flight(scene, 3)});
      const Scene plane = io::parse_scene(jelly_scene(soft_and_hard, 2), "jellies", ".");
      write(folder + "/plane.h5", {flight(plane, 4)});
    }
    ~Data() { remove_path(folder); }
    std::string folder;
  } data;
  return data.folder;
}

DataSplit open_split(const std::string& file = jelly_data() + "/train.h5") {
  DataSplitOptions options;
  options.materials = true;
  return DataSplit(file, options);
}

/// Sees everything; nothing disturbs the samples.
TrainConfig seeing(TrainConfig config) {
  for (graph::FeatureConfig* features :
       {static_cast<graph::FeatureConfig*>(&config.hgn), static_cast<graph::FeatureConfig*>(&config.gns)})
    features->material_constants = features->contact = true;
  config.seed = 7;
  config.noise_std = 0;
  return config;
}

std::string refusal(const std::string& file) {
  try {
    open_split(file);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(MaterialInputs, AreKnownForEachParticleOfTwoJellies) {
  const DataSplit split = open_split();
  ASSERT_TRUE(split.has_materials());
  for (int i = 0; i < 2; ++i) {
    const TrajectoryInfo& info = split.trajectory(i);
    const auto start = split.positions(i, 0, 1).front();
    for (std::size_t p = 0; p < start.size(); ++p) EXPECT_EQ(info.material[p], start[p][0] < 0.5f ? 1 : 0);
  }
  const DataSplit unasked(jelly_data() + "/train.h5");
  EXPECT_FALSE(unasked.has_materials());
  EXPECT_THROW(training_batch(unasked, seeing(tiny_config()), {}, 0), std::logic_error);
}

TEST(MaterialInputs, OfDataThatDoNotTellThemAreRefusedByName) {
  const std::string folder = test_folder("untold"), file = folder + "/train.h5";
  const Scene two = io::parse_scene(jelly_scene(soft_and_hard), "jellies", ".");
  Trajectory moved = flight(two, 1);
  moved.seed = 2;  // whose particles lie elsewhere
  write(file, {flight(two, 1), moved});
  EXPECT_THAT(refusal(file), HasSubstr("train.h5': trajectory 1 has two materials of one law"));
  EXPECT_NO_THROW(DataSplit{file});  // networks that see types alone need nothing of it

  const Scene untold = io::parse_scene(jelly_scene(R"({"a": {"model": "jelly"}, "b": {"model": "snow"}})"), "x", ".");
  Trajectory converted = flight(untold, 1);
  write(file, {converted});
  EXPECT_EQ(refusal(file), "");  // MPM ran with the defaults
  converted.made_by = "converted from GNS";
  write(file, {converted});
  EXPECT_THAT(refusal(file), HasSubstr("train.h5': trajectory 0 is of another program's data"));
  EXPECT_THAT(refusal(file), HasSubstr("materials.a"));
  remove_path(folder);
}

/// Batches without noise are what rollouts and evaluation see: HGN and GNS.
void expect_features_of_rollouts(const TrainConfig& config) {
  const DataSplit split = open_split(jelly_data() + (config.features().in_plane() ? "/plane.h5" : "/train.h5"));
  const graph::Normalization normalization = split.statistics(1e-4, 1);
  const graph::FeatureConfig& features = config.features();
  const Batch batch = training_batch(split, config, normalization, 0);
  const auto width = static_cast<std::size_t>(batch.feature_width);
  ASSERT_EQ(static_cast<int64_t>(width), features.input_width() - features.embedding);
  const float* row = batch.numbers.data() + batch.features.begin;
  std::set<float> stiffness;
  float near_wall = 0, near_sphere = 0;
  for (int64_t slot = 0; slot < config.batch_scenes; ++slot) {
    const SampleDraw draw = draw_training_sample(split, config, 0, slot);
    const TrajectoryInfo& info = split.trajectory(draw.key.trajectory);
    const auto history = split.history(draw.key.trajectory, draw.key.frame, features.history);
    const auto expected = graph::particle_features(features, normalization, info.context->environment, history,
                                                   info.material, draw.symmetry);
    ASSERT_TRUE(std::equal(expected.begin(), expected.end(), row)) << "slot " << slot;
    if (!config.symmetries) {
      const SceneGraph graph =
          scene_graph(config.network(), normalization, info.context->environment, {info.type_row, info.material},
                      history, grid_origin(info, config.network()));
      ASSERT_TRUE(std::equal(expected.begin(), expected.end(), graph.features.begin()));
    }
    for (std::size_t p = 0; p < info.material.size(); ++p, row += width) {
      stiffness.insert(row[width - 14]);
      near_wall += row[width - 6];    // slips
      near_sphere += row[width - 4];  // sticks
    }
  }
  EXPECT_EQ(stiffness, (std::set<float>{static_cast<float>(std::log(0.1)), static_cast<float>(std::log(3.0))}));
  EXPECT_GT(near_wall, 0);
  EXPECT_GT(near_sphere, 0);
}

TEST(MaterialInputs, OfBatchesAreThoseOfRollouts) {
  for (TrainConfig config : {seeing(tiny_config()), seeing(tiny_gns_config())}) {
    expect_features_of_rollouts(config);
    config.symmetries = true;
    expect_features_of_rollouts(config);
    config.hgn.dimensions = config.gns.dimensions = 2;
    expect_features_of_rollouts(config);
  }
}

/// Batches made on a device, obstacle particles of GNS included.
void expect_the_batches_of_the_cpu(TrainConfig config, Device device, double tolerance) {
  config.noise_std = 1e-3;
  config.symmetries = true;
  const DataSplit split = open_split();
  const graph::Normalization normalization = split.statistics(1e-4, 1);
  DeviceSamples samples(split, config, normalization, device);
  for (int64_t step = 0; step < 3; ++step) {
    samples.start(step);
    const SampleArrays made = samples.take();
    const Batch batch = training_batch(split, config, normalization, step);
    ASSERT_EQ(made.rows, batch.type_row.count);
    std::vector<float> features(static_cast<std::size_t>(batch.features.count));
    device_copy(Device::cpu, features.data(), device, made.features, features.size() * sizeof(float));
    const float* expected = batch.numbers.data() + batch.features.begin;
    for (std::size_t i = 0; i < features.size(); ++i)
      ASSERT_NEAR(features[i], expected[i], tolerance * (1 + std::abs(expected[i]))) << "number " << i;
    samples.release();
  }
}

std::vector<TrainConfig> networks() {
  TrainConfig gns = seeing(tiny_gns_config());
  gns.gns.obstacle_particles = true;
  gns.gns.obstacle_spacing = 0.03;
  return {seeing(tiny_config()), gns};
}

TEST(MaterialInputs, OfBatchesMadeOnADeviceAreTheSame) {
  for (const TrainConfig& config : networks()) expect_the_batches_of_the_cpu(config, Device::cpu, 0);
}

TEST(MaterialInputs, OfBatchesMadeOnAGpuAreTheSame) {
  GRAUPEL_NEEDS_GPU();
  for (const TrainConfig& config : networks()) expect_the_batches_of_the_cpu(config, Device::cuda, 2e-5);
}

/// Pushed frames keep the constants; the weights say what they were taught, and rollouts take it.
TEST(MaterialInputs, AreTrainedAndRolledOut) {
  const std::string folder = test_folder("jelly_runs");
  for (const TrainConfig& config : networks()) {
    TrainingOptions options;
    options.data = jelly_data();
    options.run = folder + "/" + word_of(config.architecture);
    options.config = config;
    options.config.steps = 3;
    options.config.noise_std = 1e-3;
    options.config.push_steps = 1;
    options.config.push_share = 1;
    if (config.architecture == Architecture::gns) options.config.push_steps = 0;
    options.config.rollout_frames = 2;
    options.threads = 1;
    options.version = "test";
    const TrainingResult result = train_network(options);
    ASSERT_TRUE(result.validation);
    const graph::LearnedSimulator simulator(result.weights_file);
    EXPECT_TRUE(simulator.config().material_constants && simulator.config().contact);
    const auto box = nn::TrainedBox::load(simulator.weights());
    EXPECT_EQ(box.ranges.at("jelly.youngs_modulus"), std::make_pair(3e4, 9e5));
    EXPECT_EQ(box.ranges.at("contact.friction"), std::make_pair(0.0, 0.4));
    EXPECT_EQ(box.contacts, (std::set<std::string>{"separate", "slip", "stick"}));
    const DataSplit split = open_split(jelly_data() + "/valid.h5");
    const TrajectoryInfo& info = split.trajectory(0);
    graph::LearnedSimulator::RolloutOptions rollout{.frames = 3, .progress = {}};
    rollout.material = info.material;
    rollout.free_flight = false;
    const std::vector<int32_t> types(info.material.size(), 4);
    const auto run = [&] {
      return simulator
          .rollout(info.context->scene, info.context->environment, types,
                   split.history(0, 4, simulator.config().history), rollout)
          .frames.at(3)
          .position;
    };
    const auto mixed = run();
    rollout.material.assign(types.size(), 0);
    EXPECT_TRUE(run() != mixed) << "the same whatever they are made of";
  }
  remove_path(folder);
}

}  // namespace
}  // namespace graupel::train
