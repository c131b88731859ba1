#include "graph/networks/gns_network.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "core/math/random.h"
#include "core/parallel/device.h"
#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "graph/topology/gns_graph.h"
#include "random_input.h"
#include "reference_gns.h"

namespace graupel::graph {
namespace {

GnsConfig small_config() {
  GnsConfig config;
  config.latent = 24;
  config.message_passing = 3;
  config.embedding = 5;
  config.history = 2;
  config.radius = 0.05;
  return config;
}

std::vector<float> evaluate(const GnsNetwork& network, const Input& input) {
  return network.forward(input.features, input.type, input.position);
}

void expect_reference(const nn::Weights& weights, const Input& input) {
  const std::vector<float> output = evaluate(GnsNetwork(weights), input);
  const std::vector<double> expected = reference_gns(weights, input.features, input.type, input.position);
  ASSERT_EQ(output.size(), expected.size());
  const double scale = largest(output);
  EXPECT_GT(scale, 0.02);
  for (std::size_t i = 0; i < output.size(); ++i) EXPECT_NEAR(output[i], expected[i], 1e-4 * scale) << i;
}

class GnsAgainstTheFormulas : public ::testing::TestWithParam<GnsConfig> {};

TEST_P(GnsAgainstTheFormulas, OutputsAgree) {
  const nn::Weights weights = random_weights(GetParam(), {}, 3);
  expect_reference(weights, random_input(GetParam(), 60));
}

std::vector<GnsConfig> configs_to_check() {
  GnsConfig two_layers = small_config(), three_layers = small_config(), leaky = small_config(), wide = small_config(),
            one_step = small_config(), narrow = small_config(), bundled = small_config();
  two_layers.hidden_layers = 2;
  three_layers.hidden_layers = 3;
  leaky.leaky_slope = 0.3;
  leaky.hidden_layers = 2;
  wide.latent = 72;
  wide.signed_distance = true;
  wide.cell_normal = false;
  one_step.message_passing = 1;
  one_step.latent = 32;
  narrow.latent = 8;  // more features than latent columns
  narrow.history = 16;
  bundled.hidden_layers = 2;
  bundled.bundle = 3;
  return {small_config(), two_layers, three_layers, leaky, wide, one_step, narrow, bundled};
}
INSTANTIATE_TEST_SUITE_P(Configs, GnsAgainstTheFormulas, ::testing::ValuesIn(configs_to_check()));

TEST(GnsNetwork, PaperConfigAgreesWithTheFormulas) {
  const GnsConfig config;
  expect_reference(random_weights(config, {}, 4), random_input(config, 8, 2, 0.015));
}

TEST(GnsNetwork, MoreNeighboursThanRowsOfATileAndLoneParticles) {
  Input input = random_input(small_config(), 150, 1, 0.01);  // all 149 are neighbours of all
  input.position[7] = {0.9f, -0.05f, 0.5f};
  expect_reference(random_weights(small_config(), {}), input);
}

TEST(GnsNetwork, PermutingParticlesPermutesOutputs) {
  const GnsConfig config = small_config();
  const GnsNetwork network(random_weights(config, {}));
  const Input input = random_input(config, 300);
  const std::vector<float> output = evaluate(network, input);
  const std::vector<std::size_t> order = random_order(300);
  const std::vector<float> other = evaluate(network, in_order(input, order));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(other[i * 3 + axis], output[order[i] * 3 + axis], 1e-4 * largest(output));
}

TEST(GnsNetwork, AnyShiftLeavesOutputsUnchanged) {
  GnsConfig config = small_config();
  config.radius = 1.0 / 16;  // sums and shifts of these positions are exact
  const GnsNetwork network(random_weights(config, {}));
  Input input = random_input(config, 200);
  for (Vec3f& x : input.position)
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::round(x[axis] * 4096) / 4096;
  const std::vector<float> output = evaluate(network, input);
  Input shifted = input;
  for (Vec3f& x : shifted.position) x += Vec3f{17.0f / 4096, -3, 2.5f};
  const std::vector<float> other = evaluate(network, shifted);
  for (std::size_t i = 0; i < output.size(); ++i) EXPECT_NEAR(other[i], output[i], 1e-5 * largest(output));
}

TEST(GnsNetwork, InformationGoesAsFarAsTheStepsReach) {
  GnsConfig config = small_config();  // three steps
  const GnsNetwork network(random_weights(config, {}));
  Input chain = random_input(config, 6);
  for (int i = 0; i < 6; ++i) chain.position[static_cast<std::size_t>(i)] = {0.049f * static_cast<float>(i), 0, 0};
  const std::vector<float> before = evaluate(network, chain);
  chain.features[0] += 1;  // of particle 0
  const std::vector<float> after = evaluate(network, chain);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NE(after[3 * i], before[3 * i]) << i;
  for (std::size_t i = 4; i < 6; ++i) EXPECT_EQ(after[3 * i], before[3 * i]) << i;
}

TEST(GnsNetwork, ResultsDoNotDependOnThreadsOrEarlierFrames) {
  const GnsConfig config = small_config();
  const GnsNetwork network(random_weights(config, {}));
  const Input input = random_input(config, 500), larger = random_input(config, 900, 5);
  set_num_threads(1);
  const std::vector<float> one = evaluate(network, input);
  set_num_threads(3);
  EXPECT_EQ(evaluate(network, input), one);
  evaluate(network, larger);
  EXPECT_EQ(evaluate(network, input), one);
  set_num_threads(2);
  std::vector<float> a, b;
  std::thread other([&] { a = evaluate(network, input); });
  b = evaluate(network, input);
  other.join();
  EXPECT_EQ(a, one);
  EXPECT_EQ(b, one);
  set_num_threads(0);
}

TEST(GnsNetwork, NoParticlesHaveNoAccelerations) {
  EXPECT_TRUE(GnsNetwork(random_weights(small_config(), {})).forward({}, {}, {}).empty());
}

Scene scene_with_floor() {
  Scene scene;
  Obstacle box;
  box.shape = Shape::box;
  box.size = {0.3, 0.2, 0.3};
  box.position = {0.5, 0.1, 0.5};
  scene.obstacles.push_back(box);
  return scene;
}

TEST(GnsNetwork, ObstacleParticlesActAndRest) {
  GnsConfig config = small_config();
  config.obstacle_particles = true;
  config.obstacle_spacing = 1.0 / 40;
  config.cell_normal = false;
  const nn::Weights weights = random_weights(config, {}, 2);
  const GnsNetwork network(weights);
  const Scene scene = scene_with_floor();
  const Environment environment(scene), empty{Scene{}};
  EXPECT_GT(environment.obstacle_particles.at_spacing(config.obstacle_spacing).size(), 100u);
  std::vector<std::vector<Vec3f>> positions(3, {{0.5f, 0.22f, 0.5f}, {0.52f, 0.22f, 0.5f}, {0.5f, 0.9f, 0.5f}});
  for (Vec3f& x : positions[0]) x[1] += 0.001f;
  const std::vector<int32_t> type = {5, 6, 8};
  FrameTiming timing;
  const std::vector<float> with = network.predict(environment, type, positions, timing),
                           without = network.predict(empty, type, positions, timing);
  ASSERT_EQ(with.size(), 9u);
  EXPECT_GT(std::abs(with[0] - without[0]), 1e-4);
  EXPECT_GT(std::abs(with[3] - without[3]), 1e-4);
  for (std::size_t d = 6; d < 9; ++d) EXPECT_EQ(with[d], without[d]);  // 14 radii above the floor, three steps

  // The same from the definition: all obstacle particles, resting, of the obstacles' type.
  std::vector<std::vector<Vec3f>> all = positions;
  std::vector<int32_t> types = type;
  const auto& on_obstacles = environment.obstacle_particles.at_spacing(config.obstacle_spacing);
  for (auto& frame : all) frame.insert(frame.end(), on_obstacles.begin(), on_obstacles.end());
  types.insert(types.end(), on_obstacles.size(), 3);
  const auto features = particle_features(config, network.normalization(), environment, all);
  const std::vector<double> expected = reference_gns(weights, features, types, all.back());
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(with[i], expected[i], 1e-4 * largest(with)) << i;
}

std::string error_of(const nn::Weights& weights) {
  try {
    const GnsNetwork network(weights);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(GnsNetwork, DamagedWeightsAreInputErrorsThatNameTheFile) {
  GnsConfig config = small_config();
  config.hidden_layers = 2;
  const nn::Weights good = random_weights(config, {});
  EXPECT_EQ(error_of(good), "");
  const auto expect = [&](const char* text, const auto& damage) {
    nn::Weights bad = good;
    damage(bad);
    const std::string message = error_of(bad);
    EXPECT_NE(message.find(text), std::string::npos) << message;
    EXPECT_NE(message.find("random.safetensors"), std::string::npos) << message;
  };
  expect("architecture 'hgn', supported: 'gns'", [](auto& w) { w.metadata["architecture"] = "hgn"; });
  expect("format_version '2', supported: '1'", [](auto& w) { w.metadata["format_version"] = "2"; });
  expect("'gns.radius' is missing", [](auto& w) { w.metadata.erase("gns.radius"); });
  expect("'gns.hidden_layers' is out of range ('0', allowed from 1 to 4)",
         [](auto& w) { w.metadata["gns.hidden_layers"] = "0"; });
  expect("'gns.spacing' is not known", [](auto& w) { w.metadata["gns.spacing"] = "1"; });
  expect("'step.2.node.norm.bias' is missing", [](auto& w) { w.tensors.erase("step.2.node.norm.bias"); });
  expect("'step.1.edge.layer3.weight' is missing", [](auto& w) { w.tensors.erase("step.1.edge.layer3.weight"); });
  expect("'encoder.edge.layer2.weight' is missing", [](auto& w) { w.tensors.erase("encoder.edge.layer2.weight"); });
  expect("another shape ([24, 20], needed [24, 23])", [](auto& w) { w.metadata["gns.history"] = "3"; });
  expect("'step.3.edge.layer1.weight' is missing", [](auto& w) { w.metadata["gns.message_passing"] = "4"; });
  expect("'encoder.node.layer4.weight' is missing", [](auto& w) { w.metadata["gns.hidden_layers"] = "3"; });
  expect("another shape ([24, 24], needed [3, 24])", [](auto& w) { w.metadata["gns.hidden_layers"] = "1"; });
  expect("element 1 is nan", [](auto& w) {
    w.tensors["decoder.layer3.bias"] = nn::Tensor::from_float({0, std::nanf(""), 0}, {3});
  });
  expect("normalization.velocity_std is not", [](auto& w) {
    w.tensors["normalization.velocity_std"] = nn::Tensor::from_float({1, 0, 1}, {3});
  });
}

TEST(GnsNetwork, AnUnknownParticleTypeIsAnInputError) {
  const GnsNetwork network(random_weights(small_config(), {}));
  Input input = random_input(small_config(), 10);
  input.type[3] = 9;
  EXPECT_THROW(evaluate(network, input), InputError);
}

TEST(GnsConfig, MetadataRoundTripKeepsEveryValue) {
  GnsConfig config;
  config.latent = 64;
  config.hidden_layers = 2;
  config.radius = 0.1 / 3;
  config.obstacle_particles = true;
  config.obstacle_spacing = 0.01 / 7;
  config.leaky_slope = 0.01;
  const auto metadata = config.to_metadata();
  EXPECT_EQ(metadata.at("architecture"), "gns");
  EXPECT_EQ(metadata.at("gns.obstacle_particles"), "true");
  const GnsConfig read = GnsConfig::from_metadata(metadata, "f");
  EXPECT_EQ(read.to_metadata(), metadata);
  EXPECT_EQ(read.radius, config.radius);
  EXPECT_DOUBLE_EQ(read.reach(), 1.0 / 3);
}

TEST(LoadNetwork, ChoosesByTheArchitecture) {
  const auto gns = load_network(random_weights(small_config(), {}));
  EXPECT_EQ(gns->feature_config().history, 2);
  HgnConfig config;
  config.latent = 8;
  config.history = 3;
  EXPECT_EQ(load_network(random_weights(config, {}))->feature_config().history, 3);
  nn::Weights other;
  other.file = "other.safetensors";
  EXPECT_THROW(load_network(other), InputError);
  other.metadata["architecture"] = "nsf";
  try {
    load_network(other);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what())
                  .find("'other.safetensors' holds no graph network (architecture 'nsf', "
                        "supported: 'hgn', 'gns')"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace graupel::graph
