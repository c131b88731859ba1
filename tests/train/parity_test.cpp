// The libtorch twin and the inference engine of graph/ compute the same function of the same weights.
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "graph/features/features.h"
#include "graph/features/normalization.h"
#include "graph/learned_simulator.h"
#include "graph/networks/graph_network.h"
#include "io/scene/scene_reader.h"
#include "mpm/simulation.h"
#include "train/networks/network_module.h"

namespace graupel::train {
namespace {

/// Two clouds that touch many cells, some far from others, with coordinates below zero.
std::vector<Vec3f> clouds(int n) {
  const Random random(3, RandomPurpose::test);
  std::vector<Vec3f> position;
  for (int i = 0; i < n; ++i) {
    const auto draw = static_cast<uint64_t>(i);
    const double shift = i % 2 ? -0.2 : 0.5, edge = i % 2 ? 0.1 : 0.3;
    position.push_back({static_cast<float>(shift + edge * random.uniform(draw, 0)),
                        static_cast<float>(shift + edge * random.uniform(draw, 1)),
                        static_cast<float>(shift + edge * random.uniform(draw, 2))});
  }
  return position;
}

void check_equal(const std::vector<float>& expected, const std::vector<float>& actual) {
  ASSERT_EQ(actual.size(), expected.size());
  double difference2 = 0, size2 = 0, largest = 0;
  for (std::size_t i = 0; i < actual.size(); ++i) {
    difference2 += std::pow(actual[i] - expected[i], 2);
    size2 += std::pow(expected[i], 2);
    largest = std::max(largest, std::abs(static_cast<double>(actual[i]) - expected[i]));
  }
  EXPECT_GT(size2, 0);
  EXPECT_LT(std::sqrt(difference2 / size2), 1e-4);
  EXPECT_LT(largest, 1e-3 * std::sqrt(size2 / static_cast<double>(actual.size())));
}

void check_parity(const graph::HgnConfig& config, int particles) {
  const NetworkModule module(config, Device::cpu, 11);
  nn::Weights weights = module.state(StateArray::weights);
  weights.metadata = config.to_metadata();
  graph::add_normalization(weights, {});
  const graph::GraphNetwork engine(weights);

  const std::vector<Vec3f> position = clouds(particles);
  SceneGraph scene;
  scene.hierarchy =
      sparsegrid::build_hierarchy<3>(position, config.spacing, {0.01, 0.02, 0.03}, static_cast<int>(config.levels));
  const Random random(4, RandomPurpose::test);
  std::vector<int32_t> types;
  constexpr int32_t ids[] = {5, 6, 8, 4};
  for (int i = 0; i < particles; ++i) {
    types.push_back(ids[i % 4]);
    scene.type_row.push_back(graph::embedding_row(ids[i % 4]));
    for (int64_t k = 0; k < config.input_width() - config.embedding; ++k) {
      double a, b;
      random.normal(static_cast<uint64_t>(i * 100 + k), 0, a, b);
      scene.features.push_back(static_cast<float>(a));
    }
  }
  const std::vector<float> expected = engine.forward(scene.features, types, position, {0.01, 0.02, 0.03});
  const Batch batch = concatenate({scene});
  check_equal(expected, module.predict(batch, StateArray::weights));
  for (const graph::FirstLayers first_layers : {graph::FirstLayers::whole, graph::FirstLayers::split})
    check_equal(expected, module.time_prediction(batch, StateArray::weights, first_layers, 0, 1).accelerations);
}

class HgnParity : public testing::TestWithParam<graph::Aggregation> {};
INSTANTIATE_TEST_SUITE_P(Parity, HgnParity,
                         testing::Values(graph::Aggregation::messages, graph::Aggregation::activations),
                         [](const auto& param) { return word_of(param.param); });

TEST_P(HgnParity, PaperSizeNetwork) {
  graph::HgnConfig config;
  config.aggregation = GetParam();
  check_parity(config, 300);
}

TEST_P(HgnParity, SmallNetworkWithSignedDistance) {
  graph::HgnConfig config;
  config.aggregation = GetParam();
  config.latent = 32;
  config.levels = 3;
  config.message_passing = 2;
  config.signed_distance = true;
  check_parity(config, 500);
}

TEST_P(HgnParity, BundleOfThreeFrames) {
  graph::HgnConfig config;
  config.aggregation = GetParam();
  config.latent = 32;
  config.levels = 2;
  config.message_passing = 2;
  config.bundle = 3;
  check_parity(config, 400);
}

/// What the program computes: the shipped network on the particles of a shared scene, at its start (ballistic past) and
/// after two thirds of a second of MPM, when the bodies lie on obstacles and in each other.
TEST(Parity, ShippedWeightsOnASharedScene) {
  const nn::Weights weights = nn::read_safetensors(GRAUPEL_SOURCE_DIR "/models/hgn.safetensors");
  const graph::HgnConfig config = graph::HgnConfig::from_metadata(weights.metadata, "hgn.safetensors");
  const graph::Normalization normalization = graph::read_normalization(weights);
  const graph::GraphNetwork engine(weights);
  NetworkModule module(config, Device::cpu, 0);
  module.set_state(StateArray::weights, weights);

  const Scene scene = io::read_scene(GRAUPEL_SOURCE_DIR "/scenes/shared/mixed_blocks.json");
  const graph::Environment environment(scene);
  const auto simulation = mpm::Simulation::create(scene, {.seed = scene.seed});
  const std::vector<int32_t>& types = simulation->particle_type();
  const ParticleFrame start = simulation->frame();
  const int frames = static_cast<int>(config.history) + 1;
  auto history = graph::start_history(start.position, start.velocity, scene.gravity, scene.frame_time, frames);
  const auto check = [&] {
    SceneGraph graph;
    graph.features = graph::particle_features(config, normalization, environment, history);
    graph.hierarchy = sparsegrid::build_hierarchy<3>(history.back(), config.spacing, environment.wall_low,
                                                     static_cast<int>(config.levels));
    for (const int32_t type : types) graph.type_row.push_back(graph::embedding_row(type));
    check_equal(engine.forward(graph.features, types, history.back(), environment.wall_low),
                module.predict(concatenate({graph}), StateArray::weights));
  };
  check();
  for (int f = 0; f < 40; ++f) {
    simulation->advance_frame();
    history.erase(history.begin());
    history.push_back(simulation->frame().position);
  }
  check();
}

}  // namespace
}  // namespace graupel::train
