#include "graph/networks/hierarchical_graph_network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "core/math/random.h"
#include "core/parallel/device.h"
#include "core/system/error.h"
#include "nn/bf16_products.h"
#include "random_input.h"
#include "reference_network.h"

namespace graupel::graph {
namespace {

HgnConfig small_config(Aggregation aggregation = Aggregation::messages) {
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

sparsegrid::Hierarchy<3> hierarchy_of(const HgnConfig& config, const std::vector<Vec3f>& position,
                                      const Vec3d& origin = {0, 0, 0}) {
  return sparsegrid::build_hierarchy<3>(position, config.spacing, origin, static_cast<int>(config.levels));
}

std::vector<float> evaluate(const HierarchicalGraphNetwork& network, const Input& input) {
  return network.forward(input.features, input.type, hierarchy_of(network.config(), input.position));
}

/// Returns the largest output.
double expect_the_formulas(const nn::Weights& weights, const HierarchicalGraphNetwork& network, const Input& input) {
  const std::vector<float> output = evaluate(network, input);
  const std::vector<double> expected = reference_forward(
      weights, input.features, input.type, hierarchy_of(network.config(), input.position), input.position);
  EXPECT_EQ(output.size(), expected.size());
  const double scale = largest(output);
  for (std::size_t i = 0; i < std::min(output.size(), expected.size()); ++i)
    EXPECT_NEAR(output[i], expected[i], 1e-4 * scale) << i;
  return scale;
}

class AgainstTheFormulas : public ::testing::TestWithParam<HgnConfig> {};

TEST_P(AgainstTheFormulas, OutputsAgree) {
  const HgnConfig config = GetParam();
  const nn::Weights weights = random_weights(config, {}, 3);
  const HierarchicalGraphNetwork network(weights);
  const Input input = random_input(config, 40);
  EXPECT_GT(expect_the_formulas(weights, network, input), 0.05);
}

std::vector<HgnConfig> configs_to_check() {
  HgnConfig one_level = small_config(), deep = small_config(), wide = small_config(), narrow = small_config(),
            bundled = small_config();
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
  std::vector<HgnConfig> all = {small_config(), one_level, deep, wide, narrow, bundled};
  for (std::size_t i = 0; i < 6; ++i) {
    all.push_back(all[i]);
    all.back().aggregation = Aggregation::activations;
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Configs, AgainstTheFormulas, ::testing::ValuesIn(configs_to_check()));

class EitherAggregation : public ::testing::TestWithParam<Aggregation> {};
INSTANTIATE_TEST_SUITE_P(HierarchicalGraphNetwork, EitherAggregation,
                         ::testing::Values(Aggregation::messages, Aggregation::activations),
                         [](const auto& param) { return word_of(param.param); });

TEST_P(EitherAggregation, PaperConfigAgreesWithTheFormulas) {
  HgnConfig config;
  config.aggregation = GetParam();
  const nn::Weights weights = random_weights(config, {}, 4);
  const HierarchicalGraphNetwork network(weights);
  const Input input = random_input(config, 8, 2, 0.03);
  expect_the_formulas(weights, network, input);
}

TEST_P(EitherAggregation, PermutingParticlesPermutesOutputs) {
  const HgnConfig config = small_config(GetParam());
  const HierarchicalGraphNetwork network(random_weights(config, {}));
  const Input input = random_input(config, 300);
  const std::vector<float> output = evaluate(network, input);
  const std::vector<std::size_t> order = random_order(300);
  const std::vector<float> other = evaluate(network, in_order(input, order));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(other[i * 3 + axis], output[order[i] * 3 + axis], 1e-4 * largest(output));
}

TEST_P(EitherAggregation, ShiftByTheCoarsestPeriodLeavesOutputsUnchanged) {
  HgnConfig config = small_config(GetParam());
  config.spacing = 1.0 / 16;  // sums and shifts of these positions are exact
  const HierarchicalGraphNetwork network(random_weights(config, {}));
  Input input = random_input(config, 200);
  for (Vec3f& x : input.position)
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::round(x[axis] * 4096) / 4096;
  const std::vector<float> output = evaluate(network, input);
  const float period = static_cast<float>(config.spacing) * 4;  // three levels
  Input shifted = input;
  for (Vec3f& x : shifted.position) x += Vec3f{period, -3 * period, 2 * period};  // below the origin, too
  const std::vector<float> other = evaluate(network, shifted);
  for (std::size_t i = 0; i < output.size(); ++i) EXPECT_EQ(other[i], output[i]);

  Input half = input;  // half a period is another place in the coarse cells
  for (Vec3f& x : half.position) x[0] += period / 2;
  EXPECT_GT(std::abs(evaluate(network, half)[0] - output[0]), 1e-5);
}

TEST_P(EitherAggregation, ResultsDoNotDependOnThreadsOrEarlierFrames) {
  const HgnConfig config = small_config(GetParam());
  const HierarchicalGraphNetwork network(random_weights(config, {}));
  const Input input = random_input(config, 500), larger = random_input(config, 900, 5);
  set_num_threads(1);
  const std::vector<float> one = evaluate(network, input);
  set_num_threads(3);
  const std::vector<float> three = evaluate(network, input);
  EXPECT_EQ(one, three);
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

TEST_P(EitherAggregation, ProductsInBf16ChangeLittle) {
  if (!nn::has_bf16_units()) GTEST_SKIP() << "this processor has no units for bf16";
  for (const auto& [latent, units] : {std::pair{72, nn::Bf16Extension::matrices},
                                      {128, nn::Bf16Extension::matrices},
                                      {128, nn::Bf16Extension::vectors}}) {
    HgnConfig config = small_config(GetParam());
    config.latent = latent;
    const HierarchicalGraphNetwork network(random_weights(config, {}));
    const Input input = random_input(config, 700);
    const std::vector<float> exact = evaluate(network, input);
    nn::use_bf16_units(units);
    const std::vector<float> rounded = evaluate(network, input), again = evaluate(network, input);
    set_num_threads(1);
    const std::vector<float> one_thread = evaluate(network, input);
    set_num_threads(0);
    nn::use_bf16_products(false);
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

TEST_P(EitherAggregation, ManyParticlesInOneCellAndLoneParticles) {
  HgnConfig config = small_config(GetParam());
  const nn::Weights weights = random_weights(config, {});
  const HierarchicalGraphNetwork network(weights);
  Input input = random_input(config, 150, 1, 0.01);  // several runs of rows for one cell
  input.position[7] = {0.9f, 0.05f, 0.5f};
  expect_the_formulas(weights, network, input);
  EXPECT_TRUE(network
                  .forward({}, {},
                           sparsegrid::Hierarchy<3>{.spacing = 1,
                                                    .origin = {0, 0, 0},
                                                    .levels = std::vector<sparsegrid::HierarchyLevel<3>>(3),
                                                    .cell = {},
                                                    .weight = {},
                                                    .offset = {}})
                  .empty());
}

std::string error_of(const nn::Weights& weights) {
  try {
    const HierarchicalGraphNetwork network(weights);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(HierarchicalGraphNetwork, DamagedWeightsAreInputErrorsThatNameTheFile) {
  const nn::Weights good = random_weights(small_config(), {});
  EXPECT_EQ(error_of(good), "");
  const auto expect = [&](const char* text, const auto& damage) {
    nn::Weights bad = good;
    damage(bad);
    const std::string message = error_of(bad);
    EXPECT_NE(message.find(text), std::string::npos) << message;
    EXPECT_NE(message.find("random.safetensors"), std::string::npos) << message;
  };
  expect("architecture 'gns', supported: 'hgn'", [](auto& w) { w.metadata["architecture"] = "gns"; });
  expect("architecture '', supported: 'hgn'", [](auto& w) { w.metadata.clear(); });
  expect("format_version '2', supported: '1'", [](auto& w) { w.metadata["format_version"] = "2"; });
  expect("'up.1.2.cell.norm.bias' is missing", [](auto& w) { w.tensors.erase("up.1.2.cell.norm.bias"); });
  expect("'restrict.1.layer1.weight' is missing", [](auto& w) { w.tensors.erase("restrict.1.layer1.weight"); });
  expect("'particle_to_grid.gather.weight' is missing", [](auto& w) { w.metadata["hgn.aggregation"] = "activations"; });
  expect("another shape ([24, 20], needed [24, 23])", [](auto& w) { w.metadata["hgn.history"] = "3"; });
  expect("'embedding.weight' has another shape", [](auto& w) { w.tensors["embedding.weight"].shape = {5, 9}; });
  expect("element 1 is nan", [](auto& w) {
    w.tensors["decoder.layer2.bias"] = nn::Tensor::from_float({0, std::nanf(""), 0}, {3});
  });
  expect("normalization.velocity_std is not", [](auto& w) {
    w.tensors["normalization.velocity_std"] = nn::Tensor::from_float({1, 0, 1}, {3});
  });
  expect("normalization.acceleration_mean' is missing",
         [](auto& w) { w.tensors.erase("normalization.acceleration_mean"); });
}

TEST(HierarchicalGraphNetwork, AnUnknownParticleTypeIsAnInputError) {
  const HierarchicalGraphNetwork network(random_weights(small_config(), {}));
  Input input = random_input(small_config(), 10);
  input.type[3] = 9;
  EXPECT_THROW(evaluate(network, input), InputError);
  input.type[3] = -1;
  EXPECT_THROW(evaluate(network, input), InputError);
}

}  // namespace
}  // namespace graupel::graph
