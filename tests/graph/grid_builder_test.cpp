// The links made on a device are those of sparsegrid::build_hierarchy and of the sorted lists made of it.
#include "graph/grid_builder.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "core/error.h"
#include "core/random.h"
#include "sparsegrid/hierarchy.h"
#include "tests/gpu_only.h"

namespace graupel::graph {
namespace {

constexpr double spacing = 0.07;
constexpr int levels = 4;

struct Cloud {
  SceneGrid grid;
  std::vector<Vec3f> position;
};

Cloud make_cloud(uint64_t seed, int64_t particles, const Vec3d& low, const Vec3d& high) {
  const Random random(seed, RandomPurpose::test);
  Cloud cloud{{low - Vec3d::filled(0.31), low, high, particles}, {}};
  for (uint64_t i = 0; i < static_cast<uint64_t>(particles); ++i) {
    Vec3f x;
    for (int d = 0; d < 3; ++d) x[d] = static_cast<float>(random.uniform(i, d, low[d], high[d]));
    cloud.position.push_back(x);
  }
  return cloud;
}

std::vector<Cloud> clouds() {
  return {make_cloud(1, 300, {-0.5, -0.2, -0.9}, {0.1, 0.3, -0.4}), make_cloud(2, 40, {0, 0, 0}, {1, 1, 1}),
          make_cloud(3, 1, {2, 2, 2}, {2.5, 2.1, 2.1})};
}

/// The arrays on the host.
struct HostLinks {
  GridCounts counts;
  std::vector<Vec3i> coordinate;
  std::vector<int32_t> neighbor, parent, octant, edge_begin, sender, receiver, slot, reverse, child_begin, child,
      children;
  std::vector<int32_t> cell, pair_begin, pair;
  std::vector<float> weight, offset;
  std::vector<int64_t> first_cell = {0}, first_edge = {0};
};

template <typename T>
std::vector<T> host_copy(Device device, const T* data, int64_t count) {
  std::vector<T> values(static_cast<std::size_t>(count));
  device_copy(Device::cpu, values.data(), device, data, values.size() * sizeof(T));
  return values;
}

HostLinks build_on(Device device, GridBuilder& builder, const std::vector<Cloud>& all) {
  std::vector<SceneGrid> grids;
  std::vector<Vec3f> position;
  for (const Cloud& cloud : all) {
    grids.push_back(cloud.grid);
    position.insert(position.end(), cloud.position.begin(), cloud.position.end());
  }
  Buffer<Vec3f> on_device(device, 0);
  on_device.upload(position);
  builder.prepare(grids);
  builder.build(on_device.data());
  HostLinks host;
  host.counts = builder.counts();
  const GridLinks links = builder.links();
  for (std::size_t l = 0; l < levels; ++l) {
    host.first_cell.push_back(host.first_cell.back() + host.counts.cells[l]);
    host.first_edge.push_back(host.first_edge.back() + host.counts.edges[l]);
  }
  const int64_t cells = host.first_cell.back(), edges = host.first_edge.back();
  const auto n = static_cast<int64_t>(position.size());
  host.coordinate = host_copy(device, links.coordinate, cells);
  host.neighbor = host_copy(device, links.neighbor, 6 * cells);
  host.parent = host_copy(device, links.parent, host.first_cell[levels - 1]);
  host.octant = host_copy(device, links.octant, cells);
  host.edge_begin = host_copy(device, links.edge_begin, cells + 1);
  host.sender = host_copy(device, links.sender, edges);
  host.receiver = host_copy(device, links.receiver, edges);
  host.slot = host_copy(device, links.slot, edges);
  host.reverse = host_copy(device, links.reverse, edges);
  host.child_begin = host_copy(device, links.child_begin, cells + 1);
  host.child = host_copy(device, links.child, host.first_cell[levels - 1]);
  host.children = host_copy(device, links.children, 8 * cells);
  host.cell = host_copy(device, links.cell, 8 * n);
  host.weight = host_copy(device, links.weight, 8 * n);
  host.offset = host_copy(device, links.offset, 3 * n);
  host.pair_begin = host_copy(device, links.pair_begin, host.counts.cells[0] + 1);
  host.pair = host_copy(device, links.pair, 8 * n);
  return host;
}

/// A fused multiply-add may change the last bit of an offset in f64, and so to which of two neighbouring f32 numbers it
/// is rounded. A weight is a product of three offsets or of 1 - offset, with two roundings of its own.
constexpr double offset_rounding = 0x1p-24;

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
