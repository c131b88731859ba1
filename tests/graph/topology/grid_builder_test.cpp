// The links made on a device are those of sparsegrid::build_hierarchy and of the sorted lists made of it.
#include "graph/topology/grid_builder.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "core/system/error.h"
#include "sparsegrid/hierarchy.h"
#include "tests/gpu_only.h"
#include "tests/graph/topology/grid_case.h"

namespace graupel::graph {
namespace {

void expect_cells_of(const HostLinks& links, const std::vector<Cloud>& all) {
  std::vector<int64_t> first(levels, 0);  // cells of the scenes before, by level
  std::size_t particle = 0;
  for (const Cloud& cloud : all) {
    const auto hierarchy = sparsegrid::build_hierarchy<3>(cloud.position, spacing, cloud.grid.origin, levels);
    for (std::size_t l = 0; l < levels; ++l) {
      const auto& level = hierarchy.levels[l];
      for (std::size_t c = 0; c < level.size(); ++c) {
        const auto at = static_cast<std::size_t>(links.first_cell[l] + first[l]) + c;
        ASSERT_EQ(links.coordinate[at], level.coordinate[c]);
        ASSERT_EQ(links.octant[at], level.octant[c]);
        for (std::size_t k = 0; k < 6; ++k)
          ASSERT_EQ(links.neighbor[6 * at + k], level.neighbor[c][k] < 0 ? -1 : level.neighbor[c][k] + first[l]);
        if (l + 1 < levels) {
          ASSERT_EQ(links.parent[at], level.parent[c] + first[l + 1]);
          const auto parent = static_cast<std::size_t>(links.first_cell[l + 1] + links.parent[at]);
          ASSERT_EQ(links.children[8 * parent + static_cast<std::size_t>(links.octant[at])],
                    c + static_cast<std::size_t>(first[l]));
        }
      }
    }
    for (std::size_t p = 0; p < cloud.position.size(); ++p, ++particle)
      for (std::size_t k = 0; k < 8; ++k) {
        ASSERT_EQ(links.cell[8 * particle + k], hierarchy.cell[p][k] + first[0]);
        ASSERT_NEAR(links.weight[8 * particle + k], hierarchy.weight[p][k], 5 * offset_rounding);
        if (k < 3) {
          ASSERT_NEAR(links.offset[3 * particle + k], hierarchy.offset[p][static_cast<int>(k)], offset_rounding);
        }
      }
    for (std::size_t l = 0; l < levels; ++l) first[l] += static_cast<int64_t>(hierarchy.levels[l].size());
  }
  for (std::size_t l = 0; l < levels; ++l) EXPECT_EQ(first[l], links.counts.cells[l]);
}

void expect_sorted_lists(const HostLinks& links) {
  for (std::size_t l = 0; l < levels; ++l) {
    const int64_t first_cell = links.first_cell[l], first_edge = links.first_edge[l];
    for (int64_t c = 0; c < links.counts.cells[l]; ++c) {
      const auto at = static_cast<std::size_t>(first_cell + c);
      auto edge = static_cast<std::size_t>(links.edge_begin[at]);
      for (int k = 0; k < 6; ++k) {
        const int32_t sender = links.neighbor[6 * at + static_cast<std::size_t>(k)];
        if (sender < 0) continue;
        ASSERT_EQ(links.sender[edge], sender);
        ASSERT_EQ(links.receiver[edge], c);
        ASSERT_EQ(links.slot[edge], k);
        const auto back = static_cast<std::size_t>(first_edge + links.reverse[edge]);
        ASSERT_EQ(links.sender[back], c);
        ASSERT_EQ(links.receiver[back], sender);
        ++edge;
      }
      ASSERT_EQ(edge, static_cast<std::size_t>(links.edge_begin[at + 1]));
      // Children are in ascending order, and all of them are there (their number is checked last).
      for (int32_t i = links.child_begin[at]; i < links.child_begin[at + 1]; ++i) {
        const auto child = static_cast<std::size_t>(links.child[static_cast<std::size_t>(i)]);
        ASSERT_EQ(links.parent[static_cast<std::size_t>(links.first_cell[l - 1]) + child], c);
        if (i > links.child_begin[at]) {
          ASSERT_GT(links.child[static_cast<std::size_t>(i)], links.child[static_cast<std::size_t>(i) - 1]);
        }
      }
    }
  }
  EXPECT_EQ(links.child_begin.back(), links.first_cell[levels - 1]);
  for (std::size_t c = 0; c + 1 < links.pair_begin.size(); ++c)
    for (auto i = static_cast<std::size_t>(links.pair_begin[c]); i < static_cast<std::size_t>(links.pair_begin[c + 1]);
         ++i) {
      ASSERT_EQ(links.cell[static_cast<std::size_t>(links.pair[i])], static_cast<int32_t>(c));
      if (i > static_cast<std::size_t>(links.pair_begin[c])) {
        ASSERT_GT(links.pair[i], links.pair[i - 1]);
      }
    }
  EXPECT_EQ(links.pair_begin.back(), static_cast<int32_t>(links.pair.size()));
  EXPECT_EQ(std::set<int32_t>(links.pair.begin(), links.pair.end()).size(), links.pair.size());
}

void expect_same_as_the_hierarchy(Device device) {
  GridBuilder builder(device, spacing, levels);
  const std::vector<Cloud> all = clouds();
  const HostLinks together = build_on(device, builder, all);
  EXPECT_FALSE(together.counts.overflow);
  expect_cells_of(together, all);
  expect_sorted_lists(together);
  // Memory that was used for more is used for less, and the other way round.
  for (const std::vector<Cloud>& some : {std::vector<Cloud>{all[1]}, all, {all[2]}, {all[0]}}) {
    const HostLinks links = build_on(device, builder, some);
    expect_cells_of(links, some);
    expect_sorted_lists(links);
  }
}

TEST(GridBuilder, LinksAreThoseOfTheHierarchy) { expect_same_as_the_hierarchy(Device::cpu); }

TEST(GridBuilder, LinksAreThoseOfTheHierarchyOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_same_as_the_hierarchy(Device::cuda);
  // Too many for one launch; cells with hundreds of pairs.
  GridBuilder builder(Device::cuda, spacing, levels);
  const std::vector<Cloud> many = {make_cloud(4, 30000, {0, 0, 0}, {0.9, 0.4, 0.7}),
                                   make_cloud(5, 9000, {0, 0, 0}, {0.2, 0.2, 0.2})};
  const HostLinks links = build_on(Device::cuda, builder, many);
  expect_cells_of(links, many);
  expect_sorted_lists(links);
}

TEST(GridBuilder, SaysThatAParticleIsOutsideItsBox) {
  GridBuilder builder(Device::cpu, spacing, levels, 1);
  std::vector<Cloud> all = clouds();
  EXPECT_FALSE(build_on(Device::cpu, builder, all).counts.overflow);
  all[1].position[7][2] = 1.3f;
  EXPECT_TRUE(build_on(Device::cpu, builder, all).counts.overflow);
  all[1].position[7][2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(build_on(Device::cpu, builder, all).counts.overflow);
}

TEST(GridBuilder, RefusesBoxesWithTooManyCells) {
  GridBuilder builder(Device::cpu, 1e-4, 1);
  EXPECT_THROW(builder.prepare({{Vec3d::zero(), Vec3d::zero(), Vec3d::filled(1), 10}}), ConfigError);
  EXPECT_THROW(builder.prepare({{Vec3d::zero(), Vec3d::zero(), {1e4, 0, 0}, 10}}), ConfigError);
}

}  // namespace
}  // namespace graupel::graph
