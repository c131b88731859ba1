#include "graph/networks/graph_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "core/parallel/device.h"
#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "nn/bf16_gemm.h"
#include "random_input.h"
#include "reference_gns.h"
#include "reference_network.h"

namespace graupel::graph {
namespace {

HgnConfig small_hgn(Aggregation aggregation = Aggregation::messages) {
  HgnConfig config;
  config.latent = 24;
  config.levels = 3;
  config.message_passing = 3;
  config.embedding = 5;
  config.history = 2;
  config.spacing = 0.05;
  config.aggregation = aggregation;
  return config;
}

GnsConfig small_gns() {
  GnsConfig config;
  config.latent = 24;
  config.message_passing = 3;
  config.embedding = 5;
  config.history = 2;
  config.radius = 0.05;
  return config;
}

nn::Weights weights_of(const NetworkConfig& config, uint64_t seed = 1) {
  return std::visit([&](const auto& c) { return random_weights(c, {}, seed); }, config);
}

Input input_of(const NetworkConfig& config, int particles, int blob_count = 3, double radius = 0.06) {
  return random_input(features_of(config), particles, blob_count, radius);
}

std::vector<float> evaluate(const GraphNetwork& network, const Input& input) {
  return network.forward(input.features, input.type, input.position);
}

/// The network by its formulas, in double precision.
std::vector<double> reference(const NetworkConfig& config, const nn::Weights& weights, const Input& input) {
  const auto* hgn = std::get_if<HgnConfig>(&config);
  if (!hgn) return reference_gns(weights, input.features, input.type, input.position);
  const auto hierarchy =
      sparsegrid::build_hierarchy<3>(input.position, hgn->spacing, Vec3d{}, static_cast<int>(hgn->levels));
  return reference_forward(weights, input.features, input.type, hierarchy, input.position);
}

/// Returns the largest output.
double expect_the_formulas(const NetworkConfig& config, const Input& input, uint64_t seed = 1) {
  const nn::Weights weights = weights_of(config, seed);
  const std::vector<float> output = evaluate(GraphNetwork(weights), input);
  const std::vector<double> expected = reference(config, weights, input);
  EXPECT_EQ(output.size(), expected.size());
  const double scale = largest(output);
  for (std::size_t i = 0; i < std::min(output.size(), expected.size()); ++i)
    EXPECT_NEAR(output[i], expected[i], 1e-4 * scale) << i;
  return scale;
}

class AgainstTheFormulas : public ::testing::TestWithParam<NetworkConfig> {};

TEST_P(AgainstTheFormulas, OutputsAgree) {
  const bool is_hgn = std::holds_alternative<HgnConfig>(GetParam());
  EXPECT_GT(expect_the_formulas(GetParam(), input_of(GetParam(), is_hgn ? 40 : 60), 3), is_hgn ? 0.05 : 0.02);
}

std::vector<NetworkConfig> hgn_configs() {
  std::vector<NetworkConfig> all;
  for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations}) {
    const HgnConfig small = small_hgn(aggregation);
    HgnConfig one_level = small, deep = small, wide = small, narrow = small, bundled = small;
    one_level.levels = 1;
    deep.levels = 4;
    deep.message_passing = 1;
    deep.latent = 32;
    wide.latent = 72;
    wide.signed_distance = true;
    wide.cell_normal = false;
    wide.levels = 2;
    narrow.latent = 8;  // more features than latent columns
    narrow.history = 16;
    narrow.p2g_scale = 1;
    bundled.latent = 8;
    bundled.bundle = most_bundle;  // more outputs than latent columns
    all.insert(all.end(), {small, one_level, deep, wide, narrow, bundled});
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Hgn, AgainstTheFormulas, ::testing::ValuesIn(hgn_configs()));

std::vector<NetworkConfig> gns_configs() {
  const GnsConfig small = small_gns();
  GnsConfig two_layers = small, three_layers = small, leaky = small, wide = small, one_step = small, narrow = small,
            bundled = small;
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
  return {small, two_layers, three_layers, leaky, wide, one_step, narrow, bundled};
}
INSTANTIATE_TEST_SUITE_P(Gns, AgainstTheFormulas, ::testing::ValuesIn(gns_configs()));

/// HGN in both forms, and GNS.
class EachNetwork : public ::testing::TestWithParam<const char*> {
 protected:
  bool is_gns() const { return std::string(GetParam()) == "gns"; }
  Aggregation aggregation() const {
    return std::string(GetParam()) == "messages" ? Aggregation::messages : Aggregation::activations;
  }
  NetworkConfig small() const {
    if (is_gns()) return small_gns();
    return small_hgn(aggregation());
  }
};
INSTANTIATE_TEST_SUITE_P(GraphNetwork, EachNetwork, ::testing::Values("messages", "activations", "gns"),
                         [](const auto& param) { return std::string(param.param); });

TEST_P(EachNetwork, PaperConfigAgreesWithTheFormulas) {
  HgnConfig hgn;
  hgn.aggregation = aggregation();
  const NetworkConfig config = is_gns() ? NetworkConfig(GnsConfig()) : NetworkConfig(hgn);
  EXPECT_GT(expect_the_formulas(config, input_of(config, 8, 2, is_gns() ? 0.015 : 0.03), 4), 0.02);
}

TEST_P(EachNetwork, PermutingParticlesPermutesOutputs) {
  const GraphNetwork network(weights_of(small()));
  const Input input = input_of(small(), 300);
  const std::vector<float> output = evaluate(network, input);
  const std::vector<std::size_t> order = random_order(300);
  const std::vector<float> other = evaluate(network, in_order(input, order));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(other[i * 3 + axis], output[order[i] * 3 + axis], 1e-4 * largest(output));
}

/// Sums and shifts of these positions are exact.
Input rounded_input(const NetworkConfig& config) {
  Input input = input_of(config, 200);
  for (Vec3f& x : input.position)
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::round(x[axis] * 4096) / 4096;
  return input;
}

TEST(GnsNetwork, AnyShiftLeavesOutputsUnchanged) {
  GnsConfig config = small_gns();
  config.radius = 1.0 / 16;
  const GraphNetwork network(weights_of(config));
  const Input input = rounded_input(config);
  const std::vector<float> output = evaluate(network, input);
  Input shifted = input;
  for (Vec3f& x : shifted.position) x += Vec3f{17.0f / 4096, -3, 2.5f};
  const std::vector<float> other = evaluate(network, shifted);
  for (std::size_t i = 0; i < output.size(); ++i) EXPECT_NEAR(other[i], output[i], 1e-5 * largest(output));
}

TEST(HgnNetwork, ShiftByTheCoarsestPeriodLeavesOutputsUnchanged) {
  for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations}) {
    HgnConfig config = small_hgn(aggregation);
    config.spacing = 1.0 / 16;
    const GraphNetwork network(weights_of(config));
    const Input input = rounded_input(config);
    const std::vector<float> output = evaluate(network, input);
    const float period = static_cast<float>(config.spacing) * 4;  // three levels
    Input shifted = input;
    for (Vec3f& x : shifted.position) x += Vec3f{period, -3 * period, 2 * period};  // below the origin, too
    EXPECT_EQ(evaluate(network, shifted), output);

    Input half = input;  // half a period is another place in the coarse cells
    for (Vec3f& x : half.position) x[0] += period / 2;
    EXPECT_GT(std::abs(evaluate(network, half)[0] - output[0]), 1e-5);
  }
}

TEST(GnsNetwork, InformationGoesAsFarAsTheStepsReach) {
  const GnsConfig config = small_gns();  // three steps
  const GraphNetwork network(weights_of(config));
  Input chain = input_of(config, 6);
  for (int i = 0; i < 6; ++i) chain.position[static_cast<std::size_t>(i)] = {0.049f * static_cast<float>(i), 0, 0};
  const std::vector<float> before = evaluate(network, chain);
  chain.features[0] += 1;  // of particle 0
  const std::vector<float> after = evaluate(network, chain);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NE(after[3 * i], before[3 * i]) << i;
  for (std::size_t i = 4; i < 6; ++i) EXPECT_EQ(after[3 * i], before[3 * i]) << i;
}

TEST_P(EachNetwork, ResultsDoNotDependOnThreadsOrEarlierFrames) {
  const GraphNetwork network(weights_of(small()));
  const Input input = input_of(small(), 500), larger = input_of(small(), 900, 5);
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

TEST(HgnNetwork, ProductsInBf16ChangeLittle) {
  if (!nn::has_bf16_units()) GTEST_SKIP() << "this processor has no units for bf16";
  for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations})
    for (const auto& [latent, units] : {std::pair{72, nn::Bf16Extension::matrices},
                                        {128, nn::Bf16Extension::matrices},
                                        {128, nn::Bf16Extension::vectors}}) {
      HgnConfig config = small_hgn(aggregation);
      config.latent = latent;
      const GraphNetwork network(weights_of(config));
      const Input input = input_of(config, 700);
      const std::vector<float> exact = evaluate(network, input);
      nn::use_bf16_units(units);
      const std::vector<float> rounded = evaluate(network, input), again = evaluate(network, input);
      set_num_threads(1);
      const std::vector<float> one_thread = evaluate(network, input);
      set_num_threads(0);
      nn::set_bf16_gemm(false);
      EXPECT_EQ(rounded, again);
      EXPECT_EQ(rounded, one_thread);
      EXPECT_EQ(evaluate(network, input), exact) << "rows of another form in the same memory";
      double difference = 0, size = 0;
      for (std::size_t i = 0; i < exact.size(); ++i) {
        difference += std::pow(rounded[i] - exact[i], 2);
        size += std::pow(exact[i], 2);
      }
      if (latent == 128) {
        EXPECT_GT(difference, 0);
      }
      EXPECT_LT(std::sqrt(difference / size), 0.02) << latent;
    }
}

TEST_P(EachNetwork, ManyParticlesAtOnePlaceLoneOnesAndNone) {
  Input input = input_of(small(), 150, 1, 0.01);  // several runs of rows for one receiver
  input.position[7] = {0.9f, is_gns() ? -0.05f : 0.05f, 0.5f};
  EXPECT_GT(expect_the_formulas(small(), input), 0.02);
  EXPECT_TRUE(GraphNetwork(weights_of(small())).forward({}, {}, {}).empty());
}

TEST(GnsNetwork, ObstacleParticlesActAndRest) {
  GnsConfig config = small_gns();
  config.obstacle_particles = true;
  config.obstacle_spacing = 1.0 / 40;
  config.cell_normal = false;
  const nn::Weights weights = weights_of(config, 2);
  const GraphNetwork network(weights);
  Scene scene;
  Obstacle box;
  box.shape = Shape::box;
  box.size = {0.3, 0.2, 0.3};
  box.position = {0.5, 0.1, 0.5};
  scene.obstacles.push_back(box);
  const Environment environment(scene), empty{Scene{}};
  EXPECT_GT(environment.obstacle_particles.at_spacing(config.obstacle_spacing).size(), 100u);
  std::vector<std::vector<Vec3f>> positions(3, {{0.5f, 0.22f, 0.5f}, {0.52f, 0.22f, 0.5f}, {0.5f, 0.9f, 0.5f}});
  for (Vec3f& x : positions[0]) x[1] += 0.001f;
  const std::vector<int32_t> type = {5, 6, 8};
  FrameTiming timing;
  const std::vector<float> with = network.predict(environment, type, {}, positions, timing),
                           without = network.predict(empty, type, {}, positions, timing);
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

/// Damages weights in one respect, and expects an error that says so and names the file.
class Damage {
 public:
  explicit Damage(const NetworkConfig& config) : good_(weights_of(config)) { EXPECT_NO_THROW(load_network(good_)); }

  void metadata(const char* text, const char* key, const char* value) const {
    expect(text, [&](nn::Weights& w) { w.metadata[key] = value; });
  }
  void without_tensor(const char* name) const {
    expect(("'" + std::string(name) + "' is missing").c_str(), [&](nn::Weights& w) { w.tensors.erase(name); });
  }
  void tensor(const char* text, const char* name, const std::vector<float>& values) const {
    expect(text, [&](nn::Weights& w) { w.tensors[name] = nn::Tensor::from_float(values, {3}); });
  }
  template <typename Change>
  void expect(const char* text, const Change& change) const {
    nn::Weights bad = good_;
    change(bad);
    try {
      load_network(bad);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      const std::string message = error.what();
      EXPECT_NE(message.find(text), std::string::npos) << message;
      EXPECT_NE(message.find("random.safetensors"), std::string::npos) << message;
    }
  }

 private:
  nn::Weights good_;
};

TEST_P(EachNetwork, DamagedWeightsAreInputErrorsThatNameTheFile) {
  const Damage damage(small());
  damage.metadata("holds no graph network (architecture 'nsf', supported: 'hgn', 'gns')", "architecture", "nsf");
  damage.expect("architecture '', supported: 'hgn'", [](nn::Weights& w) { w.metadata.clear(); });
  damage.metadata("format_version '2', supported: '1'", "format_version", "2");
  damage.metadata("another shape ([24, 20], needed [24, 23])", is_gns() ? "gns.history" : "hgn.history", "3");
  damage.expect("'embedding.weight' has another shape", [](nn::Weights& w) {
    w.tensors["embedding.weight"].shape = {5, 9};
  });
  damage.tensor("element 1 is nan", "decoder.layer2.bias", {0, std::nanf(""), 0});
  damage.tensor("normalization.velocity_std is not", "normalization.velocity_std", {1, 0, 1});
  damage.without_tensor("normalization.acceleration_mean");
  damage.expect("has the tensor 'encoder.layer9', which no such network has",
                [](nn::Weights& w) { w.tensors["encoder.layer9"] = w.tensors["embedding.weight"]; });
}

TEST(HgnNetwork, DamagedWeightsOfItsOwnLayers) {
  const Damage damage(small_hgn());
  damage.metadata("'gns.latent' is missing", "architecture", "gns");
  damage.without_tensor("up.1.2.cell.norm.bias");
  damage.without_tensor("restrict.1.layer1.weight");
  damage.metadata("'particle_to_grid.gather.weight' is missing", "hgn.aggregation", "activations");
}

TEST(GnsNetwork, DamagedWeightsOfItsOwnLayers) {
  GnsConfig config = small_gns();
  config.hidden_layers = 2;
  const Damage damage(config);
  damage.expect("'gns.radius' is missing", [](nn::Weights& w) { w.metadata.erase("gns.radius"); });
  damage.metadata("'gns.hidden_layers' is out of range ('0', allowed from 1 to 4)", "gns.hidden_layers", "0");
  damage.metadata("'gns.spacing' is not known", "gns.spacing", "1");
  for (const char* name :
       {"step.2.node.norm.bias", "step.1.edge.layer3.weight", "encoder.edge.layer2.weight", "step.2.edge.layer1.bias"})
    damage.without_tensor(name);
  damage.metadata("'step.3.edge.layer1.weight' is missing", "gns.message_passing", "4");
  damage.metadata("'encoder.node.layer4.weight' is missing", "gns.hidden_layers", "3");
  damage.metadata("another shape ([24, 24], needed [3, 24])", "gns.hidden_layers", "1");
}

TEST_P(EachNetwork, AnUnknownParticleTypeIsAnInputError) {
  const GraphNetwork network(weights_of(small()));
  Input input = input_of(small(), 10);
  for (const int32_t unknown : {9, -1}) {
    input.type[3] = unknown;
    EXPECT_THROW(evaluate(network, input), InputError);
  }
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
  EXPECT_DOUBLE_EQ(read.receptive_field(), 1.0 / 3);
}

}  // namespace
}  // namespace graupel::graph
