// GNS in training: parity with the inference engine, gradient against finite differences, checkpoints, batches, samples
// with obstacle particles, whole runs.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/scene/material_config.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "graph/features/normalization.h"
#include "graph/learned_simulator.h"
#include "graph/networks/graph_network.h"
#include "graph/topology/gns_graph.h"
#include "tests/train/gns_cloud.h"
#include "tests/train/learning.h"
#include "tests/train/tiny_data.h"
#include "train/data/sampling.h"
#include "train/loop/run_folder.h"
#include "train/loop/training_loop.h"
#include "train/networks/network_module.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {
namespace {

graph::GnsConfig small_config() {
  graph::GnsConfig config;
  config.latent = 8;
  config.message_passing = 3;
  config.embedding = 3;
  config.history = 2;
  config.radius = 0.08;
  return config;
}

void expect_close(const std::vector<float>& expected, const std::vector<float>& actual, std::size_t count) {
  ASSERT_EQ(actual.size(), count);
  double difference2 = 0, size2 = 0;
  for (std::size_t i = 0; i < actual.size(); ++i) {
    difference2 += std::pow(actual[i] - expected[i], 2);
    size2 += std::pow(expected[i], 2);
  }
  EXPECT_GT(size2, 0);
  EXPECT_LT(std::sqrt(difference2 / size2), 1e-5);
}

void expect_parity(const graph::GnsConfig& config, int particles, int obstacles) {
  for (const NumberType number : {NumberType::f32, NumberType::f64}) {
    const NetworkModule module(config, Device::cpu, 11, number);
    nn::Weights weights = module.state(StateArray::weights);
    weights.metadata = config.to_metadata();
    graph::add_normalization(weights, {});
    const graph::GraphNetwork engine(weights);
    const Cloud cloud = random_cloud(config, 3, particles, 0.3, obstacles);
    const std::vector<float> expected = engine.forward(cloud.scene.features, cloud.type, cloud.position);
    const Batch batch = concatenate({cloud.scene});
    const auto count = static_cast<std::size_t>(config.output_width() * (particles - obstacles));
    expect_close(expected, module.predict(batch, StateArray::weights), count);
    for (const graph::FirstLayers first_layers : {graph::FirstLayers::whole, graph::FirstLayers::split})
      expect_close(expected, module.time_prediction(batch, StateArray::weights, first_layers, 0, 1).accelerations,
                   count);
  }
}

TEST(GnsEngine, AgreeWithTheInferenceEngineInTheSizeOfThePaper) {
  for (const int64_t layers : {1, 2}) {
    graph::GnsConfig config;
    config.hidden_layers = layers;
    config.radius = 0.05;
    expect_parity(config, 300, 0);
  }
}

TEST(GnsEngine, AgreeWithTheInferenceEngineInOtherForms) {
  graph::GnsConfig config = small_config();
  config.latent = 33;
  config.leaky_slope = 0.2;
  config.hidden_layers = 3;
  config.signed_distance = true;
  config.bundle = 3;
  expect_parity(config, 200, 70);
}

/// Central differences, relative to the largest gradient of that tensor. The step is small, so that none of the many
/// units of the edges passes the kink of its activation.
void check_gradient(const graph::GnsConfig& config, const Batch& batch, int64_t checkpoint_layers) {
  NetworkModule module(config, Device::cpu, 5, NumberType::f64, checkpoint_layers);
  std::vector<double> gradient;
  module.loss_and_gradient(batch, &gradient);
  const ParameterLayout layout(config);
  const Random random(1, RandomPurpose::test, 9);
  constexpr double step = 1e-7;
  for (const Parameter& parameter : layout.parameters()) {
    double scale = 0;
    for (int64_t i = 0; i < parameter.count; ++i)
      scale = std::max(scale, std::abs(gradient[static_cast<std::size_t>(parameter.begin + i)]));
    EXPECT_GT(scale, 0) << parameter.name;
    for (uint64_t draw = 0; draw < 4; ++draw) {
      const int64_t i = parameter.begin + random.integer(draw, 0, static_cast<uint32_t>(parameter.count));
      module.nudge(i, step);
      const double above = module.loss(batch);
      module.nudge(i, -2 * step);
      const double below = module.loss(batch);
      module.nudge(i, step);
      EXPECT_NEAR(gradient[static_cast<std::size_t>(i)], (above - below) / (2 * step), 1e-5 * scale + 1e-7)
          << parameter.name << " number " << i - parameter.begin;
    }
  }
}

Batch two_scenes(const graph::GnsConfig& config) {
  return concatenate({random_cloud(config, 1, 40, 0.2, 9).scene, random_cloud(config, 2, 25, 0.3, 5).scene});
}

TEST(GnsEngine, GradientAgreesWithFiniteDifferences) {
  graph::GnsConfig config = small_config();
  config.leaky_slope = 0.1;  // of ReLU some units give nothing
  for (const int64_t layers : {1, 2, 3}) {
    config.hidden_layers = layers;
    check_gradient(config, two_scenes(config), 0);
  }
  config.latent = 9;
  config.message_passing = 1;
  config.bundle = 2;
  check_gradient(config, two_scenes(config), 1);
}

TEST(GnsEngine, CheckpointsChangeNoGradient) {
  graph::GnsConfig config = small_config();
  config.message_passing = 5;
  config.hidden_layers = 2;
  const Batch batch = two_scenes(config);
  std::vector<double> expected, gradient;
  const double loss = NetworkModule(config, Device::cpu, 5).loss_and_gradient(batch, &expected);
  for (const int64_t layers : {1, 2, 5, 9}) {
    NetworkModule module(config, Device::cpu, 5, NumberType::f32, layers);
    EXPECT_EQ(module.loss_and_gradient(batch, &gradient), loss) << layers;
    EXPECT_EQ(gradient, expected) << layers;
  }
}

TEST(GnsEngine, ABatchGivesEachSceneItsOwnPrediction) {
  const graph::GnsConfig config = small_config();
  const NetworkModule module(config, Device::cpu, 3);
  const SceneGraph a = random_cloud(config, 5, 30, 0.2, 7).scene, b = random_cloud(config, 6, 50, 0.1).scene,
                   c = random_cloud(config, 7, 12, 0.1, 2).scene;
  std::vector<float> one_by_one;
  for (const SceneGraph& scene : {a, b, c}) {
    const std::vector<float> own = module.predict(concatenate({scene}), StateArray::weights);
    one_by_one.insert(one_by_one.end(), own.begin(), own.end());
  }
  const Batch batch = concatenate({a, b, c});
  EXPECT_EQ(batch.particle_begin, (std::vector<int64_t>{0, 23, 73, 83}));
  const std::vector<float> together = module.predict(batch, StateArray::weights);
  ASSERT_EQ(together.size(), one_by_one.size());
  for (std::size_t i = 0; i < together.size(); ++i) EXPECT_NEAR(together[i], one_by_one[i], 1e-5f);
}

TEST(GnsEngine, TheNetworksOfThePapersHaveTheirSizes) {
  graph::GnsConfig config;
  EXPECT_NEAR(static_cast<double>(ParameterLayout(config).parameter_count()), 1.22e6, 0.01e6);
  config.hidden_layers = 2;  // the authors' program has 1.59 million in two dimensions
  EXPECT_NEAR(static_cast<double>(ParameterLayout(config).parameter_count()), 1.60e6, 0.01e6);
}

TEST(GnsSampling, ObstacleParticlesStandBehindTheOthersAndRest) {
  TrainConfig config = tiny_gns_config();
  config.noise_std = 0;
  config.batch_scenes = 2;
  config.gns.obstacle_particles = true;
  config.gns.obstacle_spacing = 0.02;
  config.gns.message_passing = 4;  // reaches 0.28 m: a part of the ball in the corner
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(0, 1);
  const Batch batch = training_batch(split, config, normalization, 3);
  EXPECT_EQ(batch.particles(), 48);
  EXPECT_EQ(batch.target.count, 3 * 48);
  const int64_t nodes = batch.type_row.count;
  EXPECT_GT(nodes, 48);
  EXPECT_EQ(batch.features.count, nodes * batch.feature_width);
  EXPECT_EQ(batch.level.front().cells, nodes);
  for (int64_t i = 0; i < nodes; ++i)
    EXPECT_EQ(batch.indices[static_cast<std::size_t>(batch.type_row.begin + i)] == obstacle_particle_type, i >= 48);
  // The first three features are the newest velocity: nothing, normalised.
  for (int64_t i = 48; i < nodes; ++i)
    for (int d = 0; d < 3; ++d)
      EXPECT_NEAR(batch.numbers[static_cast<std::size_t>(batch.features.begin + i * batch.feature_width + d)],
                  -normalization.velocity_mean[d] / normalization.velocity_std[d], 1e-5);

  // Training and rollout see the same: the sample without noise is what evaluation makes of the same frame.
  const SampleKey first = draw_sample(split, config.seed, 3, 0), second = draw_sample(split, config.seed, 3, 1);
  std::vector<SceneGraph> graphs;
  for (const SampleKey& key : {first, second})
    graphs.push_back(scene_graph(config.gns, normalization, split.trajectory(key.trajectory).context->environment,
                                 {split.trajectory(key.trajectory).type_row, {}},
                                 split.history(key.trajectory, key.frame, config.gns.history), {0, 0, 0}));
  const Batch expected = concatenate(graphs);
  EXPECT_EQ(batch.indices, expected.indices);
  EXPECT_EQ(std::vector<float>(batch.numbers.begin() + batch.edge_features.begin,
                               batch.numbers.begin() + batch.edge_features.begin + batch.edge_features.count),
            std::vector<float>(expected.numbers.begin() + expected.edge_features.begin, expected.numbers.end()));
  for (int64_t i = 0; i < batch.features.count; ++i)
    ASSERT_NEAR(batch.numbers[static_cast<std::size_t>(i)], expected.numbers[static_cast<std::size_t>(i)], 1e-5);
}

TEST(GnsSampling, ATurnedSceneHasATurnedGraph) {
  TrainConfig config = tiny_gns_config();
  config.gns.obstacle_particles = true;
  config.gns.obstacle_spacing = 0.02;
  const DataSplit split(tiny_data_set() + "/train.h5");
  const graph::Normalization normalization = split.statistics(config.noise_std, 1);
  bool turned_otherwise = false;
  for (int64_t step = 0; step < 4; ++step) {
    config.symmetries = false;
    const Batch plain = training_batch(split, config, normalization, step);
    config.symmetries = true;
    const Batch turned = training_batch(split, config, normalization, step);
    ASSERT_EQ(plain.indices, turned.indices);  // the same neighbours
    for (int64_t e = 0; e < plain.level.front().edges; ++e) {
      const auto at = static_cast<std::size_t>(plain.edge_features.begin + 4 * e);
      EXPECT_NEAR(plain.numbers[at + 3], turned.numbers[at + 3], 1e-5);
      turned_otherwise = turned_otherwise || std::abs(plain.numbers[at] - turned.numbers[at]) > 0.1;
    }
  }
  EXPECT_TRUE(turned_otherwise);
}

TrainingOptions tiny_options(const std::string& run) {
  TrainingOptions options;
  options.data = tiny_data_set();
  options.run = run;
  options.config = tiny_gns_config();
  options.threads = 1;
  options.version = "test";
  return options;
}

TEST(GnsTraining, LearnsToBounceAndRollsOut) {
  const std::string folder = test_folder("gns_learn");
  TrainingOptions options = tiny_options(folder + "/run");
  LossCourse loss;
  learn_fast(options, 600, loss);
  options.config.validation_samples = 40;
  options.config.checkpoint_layers = 1;
  const TrainingResult result = train_network(options);
  EXPECT_LT(loss.last, loss.first / 3);
  ASSERT_TRUE(result.validation);
  const SquaredErrors errors = result.validation->one_step.all();
  EXPECT_LT(errors.raw_mse(Predictor::network), 0.5 * errors.raw_mse(Predictor::zero));
  EXPECT_LT(result.validation->rollout_mse, 1e-3);
  // The exported weights are complete for the inference engine, and roll out a scene.
  const graph::LearnedSimulator simulator(result.weights_file);
  EXPECT_EQ(simulator.weights().metadata.at("architecture"), "gns");
  const DataSplit split(tiny_data_set() + "/valid.h5");
  const TrajectoryInfo& trajectory = split.trajectory(0);
  std::vector<int32_t> types;
  for (std::size_t p = 0; p < trajectory.type_row.size(); ++p) types.push_back(p % 2 ? 5 : 6);
  const Trajectory rollout = simulator.rollout(trajectory.context->scene, trajectory.context->environment, types,
                                               split.history(0, 2, 2), {.frames = 5, .progress = {}});
  EXPECT_EQ(rollout.diverged_at_frame, -1);
  const std::vector<Vec3f> truth = split.positions(0, 7, 1).front();
  for (std::size_t p = 0; p < truth.size(); ++p) EXPECT_LT(norm(rollout.frames.back().position[p] - truth[p]), 0.03f);
  remove_path(folder);
}

TEST(GnsTraining, TwentyStepsEqualTenAndResumedTen) {
  const std::string folder = test_folder("gns_resume");
  TrainingOptions whole = tiny_options(folder + "/whole");
  whole.config.gns.obstacle_particles = true;
  whole.config.gns.obstacle_spacing = 0.03;
  whole.config.gns.bundle = 2;
  EXPECT_TRUE(std::isfinite(train_network(whole).validation->rollout_mse));
  TrainingOptions parts = whole;
  parts.run = folder + "/parts";
  parts.stop_step = 10;
  EXPECT_EQ(train_network(parts).reason, StopReason::reached_stop_step);
  parts.stop_step = 0;
  parts.resume = true;
  parts.config = read_run_config(parts.run);
  EXPECT_EQ(parts.config.architecture, Architecture::gns);
  EXPECT_TRUE(parts.config.gns.obstacle_particles);
  EXPECT_EQ(parts.config.gns.bundle, 2);
  EXPECT_EQ(train_network(parts).reason, StopReason::finished);
  for (const StateArray array : all_state_arrays) {
    const std::string file = std::string("/checkpoints/step-00000020/") + name_of(array) + ".safetensors";
    EXPECT_TRUE(read_file(whole.run + file) == read_file(parts.run + file)) << name_of(array);
  }
  remove_path(folder);
}

TEST(GnsTraining, SettingsOfTheOtherNetworkAreRefused) {
  const auto read = [](const std::string& text) { return read_train_config(text, "settings"); };
  const TrainConfig config = read(R"({"architecture": "gns", "gns": {"hidden_layers": 2}, "checkpoint_layers": 3})");
  EXPECT_EQ(config.architecture, Architecture::gns);
  EXPECT_EQ(std::get<graph::GnsConfig>(config.network()).hidden_layers, 2);
  EXPECT_EQ(config.checkpoint_layers, 3);
  EXPECT_THROW(read(R"({"gns": {"hidden_layers": 2}})"), ConfigError);
  EXPECT_THROW(read(R"({"architecture": "gns", "hgn": {"levels": 2}})"), ConfigError);
  EXPECT_THROW(read(R"({"architecture": "gns", "jitter": "none"})"), ConfigError);
  EXPECT_THROW(read(R"({"checkpoint_layers": 3})"), ConfigError);
  EXPECT_THROW(read(R"({"architecture": "segnn"})"), ConfigError);
  EXPECT_EQ(config_hash(read_train_config(train_config_text(config), "again")), config_hash(config));
  TrainConfig other = tiny_gns_config();
  other.gns.frame_time = 0.1;
  try {
    DataSplit(tiny_data_set() + "/train.h5").check_fits(other.network());
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("Set gns.frame_time"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace graupel::train
