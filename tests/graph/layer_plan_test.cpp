#include "graph/plan/layer_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

#include "core/system/error.h"
#include "graph/plan/plan_description.h"
#include "nn/weights.h"
#include "random_weights.h"

namespace graupel::graph {
namespace {

HgnConfig small_hgn() {
  HgnConfig config;
  config.latent = 4;
  config.levels = 2;
  config.message_passing = 2;
  config.embedding = 2;
  config.history = 1;  // 12 features
  return config;
}

GnsConfig small_gns() {
  GnsConfig config;
  config.latent = 4;
  config.hidden_layers = 2;
  config.message_passing = 2;
  config.embedding = 2;
  config.history = 1;
  return config;
}

const PlanRows hgn_rows = {.particles = 3, .moving = 3, .level = {{.cells = 5, .edges = 6}, {.cells = 2, .edges = 2}}};
const PlanRows gns_rows = {.particles = 5, .moving = 4, .level = {{.cells = 0, .edges = 7}}};

/// Two operations for each number of each matrix but the embedding, in every row that it is applied to.
double flop_of_matrices(const nn::Weights& weights, const std::function<int64_t(const std::string&)>& rows) {
  int64_t sum = 0;
  for (const auto& [name, tensor] : weights.tensors)
    if ((name.find(".layer") != std::string::npos || name.find(".gather") != std::string::npos) &&
        tensor.shape.size() == 2)
      sum += 2 * tensor.shape[0] * tensor.shape[1] * rows(name);
  return static_cast<double>(sum);
}

TEST(NetworkFlop, WholeFirstLayersOfAnHgnCountEveryMatrixOnceARow) {
  const auto rows = [](const std::string& name) -> int64_t {
    if (name.starts_with("encoder") || name.starts_with("decoder")) return hgn_rows.particles;
    if (name.starts_with("particle_to_grid") || name.starts_with("grid_to_particle")) return 8 * hgn_rows.particles;
    const auto& level = hgn_rows.level[static_cast<std::size_t>(name[name.find('.') + 1] - '0')];
    return name.find(".edge.") != std::string::npos ? level.edges : level.cells;
  };
  const HgnConfig config = small_hgn();
  EXPECT_EQ(flop_of(plan_of(config), hgn_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
}

TEST(NetworkFlop, GatherLayersCountOncePairOrEdgeAndFcnsOnceAReceiver) {
  const auto rows = [](const std::string& name) -> int64_t {
    const bool gather = name.find(".gather.") != std::string::npos;
    if (name.starts_with("encoder") || name.starts_with("decoder")) return hgn_rows.particles;
    if (name.starts_with("particle_to_grid")) return gather ? 8 * hgn_rows.particles : hgn_rows.level[0].cells;
    if (name.starts_with("grid_to_particle")) return gather ? 8 * hgn_rows.particles : hgn_rows.particles;
    const auto l = static_cast<std::size_t>(name[name.find('.') + 1] - '0');
    if (name.starts_with("restrict")) return hgn_rows.level[gather ? l : l + 1].cells;
    return gather ? hgn_rows.level[l].edges : hgn_rows.level[l].cells;
  };
  HgnConfig config = small_hgn();
  config.aggregation = Aggregation::activations;
  EXPECT_EQ(flop_of(plan_of(config), hgn_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
}

TEST(NetworkFlop, WholeFirstLayersOfAGnsCountEveryMatrixOnceARow) {
  const auto rows = [](const std::string& name) {
    if (name.starts_with("decoder")) return gns_rows.moving;
    return name.find(".edge.") != std::string::npos ? gns_rows.level[0].edges : gns_rows.particles;
  };
  const GnsConfig config = small_gns();
  EXPECT_EQ(flop_of(plan_of(config), gns_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
}

// H = 4, multiply-adds. A particle: encoder 12 H + H^2 = 64, its parts of both transfers 2 H^2 = 32, second layers of 8
// pairs there and back 16 H^2 = 256, decoder H^2 + 3 H = 28: 380. A block of 2 iterations: a cell 2 x 5 H^2 = 160, an
// edge (1 + 2) H^2 = 48; twice on level 0: 2 (5 x 160 + 6 x 48) = 2176, once on level 1: 2 x 160 + 2 x 48 = 416. Cells
// of level 0: H^2 for the way back to the particles, 4 H^2 for restrict and prolong: 5 x 80 = 400; of level 1: H^2 for
// prolong: 2 x 16 = 32. In all 3 x 380 + 2176 + 416 + 400 + 32 = 4164.
TEST(NetworkFlop, SplitFirstLayersOfAnHgnByHand) { EXPECT_EQ(flop_of(plan_of(small_hgn()), hgn_rows), 2 * 4164); }

// H = 4. A particle: encoder 64, gathered there and back 2 H^2 = 32, FCN 3 H^2 = 48, decoder 28: 172. A cell of a block
// of 2 iterations: 160, as above; twice on level 0, once on level 1: 1600 + 320. Cells of level 0: 3 H^2 for the FCN of
// the particles' sums and the way back, 3 H^2 for restrict and prolong: 5 x 96 = 480; of level 1: 3 H^2: 96. In all
// 3 x 172 + 1920 + 480 + 96 = 3012.
TEST(NetworkFlop, SplitGatherLayersByHand) {
  HgnConfig config = small_hgn();
  config.aggregation = Aggregation::activations;
  EXPECT_EQ(flop_of(plan_of(config), hgn_rows), 2 * 3012);
}

// H = 4, two hidden layers: 2 H^2 = 32 behind each first layer. A particle: encoder 12 H + 32 = 80, 2 steps of 2 H^2
// for the edges, 2 H^2 and 32 for itself: 2 x 96; an edge: 4 H + 32 = 48 and 2 steps of H^2 + 32: 2 x 48; a moving
// particle: decoder 32 + 3 H = 44. In all 5 x 272 + 7 x 144 + 4 x 44 = 2544.
TEST(NetworkFlop, SplitFirstLayersOfAGnsByHand) { EXPECT_EQ(flop_of(plan_of(small_gns()), gns_rows), 2 * 2544); }

// The decoder's last layer has 3 columns more a frame: 3 H a particle, of GNS one that moves.
TEST(NetworkFlop, EachFrameOfABundleAddsItsColumnsOfTheDecoder) {
  for (const FirstLayers first_layers : {FirstLayers::whole, FirstLayers::split}) {
    for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations}) {
      HgnConfig one = small_hgn(), four = small_hgn();
      one.aggregation = four.aggregation = aggregation;
      four.bundle = 4;
      EXPECT_EQ(flop_of(plan_of(four), hgn_rows, first_layers) - flop_of(plan_of(one), hgn_rows, first_layers),
                2 * 3 * 9 * 4);
    }
    GnsConfig four = small_gns();
    four.bundle = 4;
    EXPECT_EQ(flop_of(plan_of(four), gns_rows, first_layers) - flop_of(plan_of(small_gns()), gns_rows, first_layers),
              2 * 4 * 9 * 4);
  }
}

TEST(NetworkFlop, RowsOfAHierarchyAreItsCellsAndLinks) {
  // 2 x 2 x 2 cells with three neighbours each; their parents are one cell, or as many where they straddle it.
  const PlanRows one_parent = rows_of(sparsegrid::build_hierarchy<3>({{1, 1, 1}}, 1, {0, 0, 0}, 2));
  EXPECT_EQ(one_parent.particles, 1);
  ASSERT_EQ(one_parent.level.size(), 2u);
  EXPECT_EQ(one_parent.level[0].cells, 8);
  EXPECT_EQ(one_parent.level[0].edges, 24);
  EXPECT_EQ(one_parent.level[1].cells, 1);
  EXPECT_EQ(one_parent.level[1].edges, 0);
  const PlanRows straddling = rows_of(sparsegrid::build_hierarchy<3>({{2, 2, 2}}, 1, {0, 0, 0}, 2));
  EXPECT_EQ(straddling.level[1].cells, 8);
  EXPECT_EQ(straddling.level[1].edges, 24);
}

TEST(LayerPlan, TensorsAreThoseOfTheShippedWeights) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(GRAUPEL_SOURCE_DIR "/models")) {
    if (entry.path().extension() != ".safetensors") continue;
    const nn::Weights weights = nn::read_safetensors(entry.path());
    const auto architecture = weights.metadata.find("architecture");
    if (architecture == weights.metadata.end()) continue;
    const bool hgn = architecture->second == hgn_architecture;
    if (!hgn && architecture->second != gns_architecture) continue;
    const LayerPlan plan = hgn ? plan_of(HgnConfig::from_metadata(weights.metadata, weights.file))
                               : plan_of(GnsConfig::from_metadata(weights.metadata, weights.file));
    const std::vector<PlanTensor> tensors = plan.tensors();
    EXPECT_EQ(tensors.size() + 4, weights.tensors.size()) << entry.path();  // and the statistics of normalisation
    for (const PlanTensor& tensor : tensors) {
      ASSERT_TRUE(weights.tensors.contains(tensor.name)) << entry.path() << " " << tensor.name;
      EXPECT_EQ(weights.tensors.at(tensor.name).shape, tensor.shape) << tensor.name;
    }
    ++files;
  }
  EXPECT_GE(files, 3);
}

/// docs/reference/network_plans.md, written anew where GRAUPEL_WRITE_FORMAT is set.
TEST(LayerPlan, DocumentationOfTensorsIsMadeOfThePlans) {
  HgnConfig aggregated;
  aggregated.aggregation = Aggregation::activations;
  std::string text =
      "# Plans of the graph networks\n\n"
      "Made by the program from `graph/plan/layer_plan.h` with the default settings; a test compares. What the "
      "operations\n"
      "compute stands at the top of that file. A matrix `<layer>.layer1.weight` has a bias `[outputs]` beside it; a "
      "`norm` has\n"
      "`weight` and `bias` of the layer's width. The embedding is `embedding.weight`, a row a particle type.\n";
  const auto add = [&text](const std::string& title, const LayerPlan& plan) {
    text += "\n## " + title + "\n\n" + description_of(plan);
  };
  add("HGN that aggregates activations (the shipped form)", plan_of(aggregated));
  add("HGN that aggregates messages (the paper's form)", plan_of(HgnConfig()));
  add("GNS", plan_of(GnsConfig()));
  const std::string path = std::string(GRAUPEL_SOURCE_DIR) + "/docs/reference/network_plans.md";
  if (std::getenv("GRAUPEL_WRITE_FORMAT")) std::ofstream(path, std::ios::binary) << text;
  std::ifstream file(path, std::ios::binary);
  std::stringstream found;
  found << file.rdbuf();
  EXPECT_EQ(found.str(), text) << "write it anew: GRAUPEL_WRITE_FORMAT=1 graph_test --gtest_filter=LayerPlan.*";
}

std::string refusal(const LayerPlan& plan) {
  try {
    plan.check();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(LayerPlan, LayersThatDoNotFitAreNamed) {
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  const LayerPlan good = plan_of(small_hgn());
  EXPECT_EQ(refusal(good), "accepted");
  LayerPlan plan = good;
  plan.layers[0].inputs += 1;
  EXPECT_THAT(refusal(plan),
              AllOf(HasSubstr("plan 'hgn', operation 0 (encode 'encoder')"), HasSubstr("its sources give")));
  plan = good;
  plan.operations[1].links.kind = LinkKind::cell_to_particle;
  EXPECT_THAT(refusal(plan), AllOf(HasSubstr("operation 1 (gather 'particle_to_grid')"),
                                   HasSubstr("rows of particles, wanted cells of level 0")));
  plan = good;
  plan.operations[2].sources[0].value = 9;
  EXPECT_THAT(refusal(plan), HasSubstr("value 9 is not there yet (allowed: 0 to 2)"));
  plan = good;
  plan.operations[3].layer = 0;
  EXPECT_THAT(refusal(plan), HasSubstr("the layer is used twice"));
  plan = good;
  plan.operations[1].layer = 400;
  EXPECT_THAT(refusal(plan), HasSubstr("layer 400 is not there"));
  plan = good;
  plan.layers.push_back({.name = "idle"});
  EXPECT_THAT(refusal(plan), HasSubstr("some layer is used by no operation"));
  plan = good;
  plan.values.back().width = 5;
  EXPECT_THAT(refusal(plan), HasSubstr("its value has 5"));
}

TEST(LayerPlan, AnEngineNamesWhatItLacks) {
  try {
    check_operations(plan_of(small_gns()), "toy", {"encode", "update"});
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("engine 'toy' has no operation 'gather', which plan 'gns' needs "
                                                   "(it has: encode, update)"));
  }
}

TEST(LayerPlan, BlocksAreTheWayDownTheLevelsAndUpAgain) {
  HgnConfig config = small_hgn();
  config.levels = 3;
  for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations}) {
    config.aggregation = aggregation;
    std::vector<std::string> names;
    for (const PlanBlock& block : plan_of(config).blocks) names.push_back(block.name);
    EXPECT_THAT(names, ::testing::ElementsAre("particle_to_grid", "down.0", "restrict.0", "down.1", "restrict.1",
                                              "down.2", "prolong.1", "up.1", "prolong.0", "up.0", "grid_to_particle"));
  }
}

TEST(LayerPlan, BlocksThatDoNotHoldTheGathersAreRefused) {
  using ::testing::HasSubstr;
  const LayerPlan good = plan_of(small_hgn());
  LayerPlan plan = good;
  plan.blocks[1].iterations += 1;
  EXPECT_THAT(refusal(plan), HasSubstr("its links are not those of block 1"));
  plan = good;
  plan.blocks.pop_back();
  EXPECT_THAT(refusal(plan), HasSubstr("its links are not those of block"));
  plan = good;
  plan.blocks.back().iterations = 2;
  EXPECT_THAT(refusal(plan), HasSubstr("fewer gathers than it says"));
}

}  // namespace
}  // namespace graupel::graph
