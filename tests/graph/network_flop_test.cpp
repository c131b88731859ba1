#include "graph/networks/network_flop.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

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

const HgnRows hgn_rows = {.particles = 3, .level = {{.cells = 5, .edges = 6}, {.cells = 2, .edges = 2}}};
const GnsRows gns_rows = {.particles = 5, .moving = 4, .edges = 7};

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
  EXPECT_EQ(flop_of(config, hgn_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
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
  EXPECT_EQ(flop_of(config, hgn_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
}

TEST(NetworkFlop, WholeFirstLayersOfAGnsCountEveryMatrixOnceARow) {
  const auto rows = [](const std::string& name) {
    if (name.starts_with("decoder")) return gns_rows.moving;
    return name.find(".edge.") != std::string::npos ? gns_rows.edges : gns_rows.particles;
  };
  const GnsConfig config = small_gns();
  EXPECT_EQ(flop_of(config, gns_rows, FirstLayers::whole), flop_of_matrices(random_weights(config, {}), rows));
}

// H = 4, multiply-adds. A particle: encoder 12 H + H^2 = 64, its parts of both transfers 2 H^2 = 32, second layers of 8
// pairs there and back 16 H^2 = 256, decoder H^2 + 3 H = 28: 380. A block of 2 iterations: a cell 2 x 5 H^2 = 160, an
// edge (1 + 2) H^2 = 48; twice on level 0: 2 (5 x 160 + 6 x 48) = 2176, once on level 1: 2 x 160 + 2 x 48 = 416. Cells
// of level 0: H^2 for the way back to the particles, 4 H^2 for restrict and prolong: 5 x 80 = 400; of level 1: H^2 for
// prolong: 2 x 16 = 32. In all 3 x 380 + 2176 + 416 + 400 + 32 = 4164.
TEST(NetworkFlop, SplitFirstLayersOfAnHgnByHand) { EXPECT_EQ(flop_of(small_hgn(), hgn_rows), 2 * 4164); }

// H = 4. A particle: encoder 64, gathered there and back 2 H^2 = 32, FCN 3 H^2 = 48, decoder 28: 172. A cell of a block
// of 2 iterations: 160, as above; twice on level 0, once on level 1: 1600 + 320. Cells of level 0: 3 H^2 for the FCN of
// the particles' sums and the way back, 3 H^2 for restrict and prolong: 5 x 96 = 480; of level 1: 3 H^2: 96. In all
// 3 x 172 + 1920 + 480 + 96 = 3012.
TEST(NetworkFlop, SplitGatherLayersByHand) {
  HgnConfig config = small_hgn();
  config.aggregation = Aggregation::activations;
  EXPECT_EQ(flop_of(config, hgn_rows), 2 * 3012);
}

// H = 4, two hidden layers: 2 H^2 = 32 behind each first layer. A particle: encoder 12 H + 32 = 80, 2 steps of 2 H^2
// for the edges, 2 H^2 and 32 for itself: 2 x 96; an edge: 4 H + 32 = 48 and 2 steps of H^2 + 32: 2 x 48; a moving
// particle: decoder 32 + 3 H = 44. In all 5 x 272 + 7 x 144 + 4 x 44 = 2544.
TEST(NetworkFlop, SplitFirstLayersOfAGnsByHand) { EXPECT_EQ(flop_of(small_gns(), gns_rows), 2 * 2544); }

// The decoder's last layer has 3 columns more a frame: 3 H a particle, of GNS one that moves.
TEST(NetworkFlop, EachFrameOfABundleAddsItsColumnsOfTheDecoder) {
  for (const FirstLayers first_layers : {FirstLayers::whole, FirstLayers::split}) {
    for (const Aggregation aggregation : {Aggregation::messages, Aggregation::activations}) {
      HgnConfig one = small_hgn(), four = small_hgn();
      one.aggregation = four.aggregation = aggregation;
      four.bundle = 4;
      EXPECT_EQ(flop_of(four, hgn_rows, first_layers) - flop_of(one, hgn_rows, first_layers), 2 * 3 * 9 * 4);
    }
    GnsConfig four = small_gns();
    four.bundle = 4;
    EXPECT_EQ(flop_of(four, gns_rows, first_layers) - flop_of(small_gns(), gns_rows, first_layers), 2 * 4 * 9 * 4);
  }
}

TEST(NetworkFlop, RowsOfAHierarchyAreItsCellsAndLinks) {
  // 2 x 2 x 2 cells with three neighbours each; their parents are one cell, or as many where they straddle it.
  const HgnRows one_parent = rows_of(sparsegrid::build_hierarchy<3>({{1, 1, 1}}, 1, {0, 0, 0}, 2));
  EXPECT_EQ(one_parent.particles, 1);
  ASSERT_EQ(one_parent.level.size(), 2u);
  EXPECT_EQ(one_parent.level[0].cells, 8);
  EXPECT_EQ(one_parent.level[0].edges, 24);
  EXPECT_EQ(one_parent.level[1].cells, 1);
  EXPECT_EQ(one_parent.level[1].edges, 0);
  const HgnRows straddling = rows_of(sparsegrid::build_hierarchy<3>({{2, 2, 2}}, 1, {0, 0, 0}, 2));
  EXPECT_EQ(straddling.level[1].cells, 8);
  EXPECT_EQ(straddling.level[1].edges, 24);
}

}  // namespace
}  // namespace graupel::graph
