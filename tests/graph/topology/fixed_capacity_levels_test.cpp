// The links of a grid at fixed places are the grid's, level by level; what does not fit leaves no cells.
#include "graph/topology/fixed_capacity_levels.h"

#include <gtest/gtest.h>

#include "core/math/random.h"
#include "sparsegrid/hierarchy.h"
#include "tests/gpu_only.h"

namespace graupel::graph {
namespace {

constexpr double spacing = 0.05;
constexpr int levels = 4;

std::vector<Vec3f> cloud(uint64_t seed, int particles, double edge) {
  const Random random(seed, RandomPurpose::test);
  std::vector<Vec3f> position;
  for (int i = 0; i < particles; ++i) {
    Vec3f x;
    for (int d = 0; d < 3; ++d)
      x[d] = static_cast<float>(random.uniform(static_cast<uint64_t>(i), d, 0.5 - edge / 2, 0.5 + edge / 2));
    position.push_back(x);
  }
  return position;
}

std::vector<int32_t> on_host(Device device, const int32_t* numbers, std::size_t count) {
  std::vector<int32_t> values(count);
  device_copy(Device::cpu, values.data(), device, numbers, count * sizeof(int32_t));
  return values;
}

class Places {
 public:
  explicit Places(Device device) : device_(device), builder_(device, spacing, levels), places(device) {}

  GridCounts build(const std::vector<Vec3f>& position) {
    particles_ = static_cast<int64_t>(position.size());
    Buffer<Vec3f> there(device_, 0);
    there.upload(position);
    builder_.prepare({{{0, 0, 0}, {0, 0, 0}, {1, 1, 1}, particles_}});
    builder_.build(there.data());
    return builder_.counts();
  }
  void place() { places.place(builder_.links(), particles_); }
  int32_t number(const int32_t* at) const { return on_host(device_, at, 1)[0]; }
  std::vector<int32_t> numbers(const int32_t* at, std::size_t count) const { return on_host(device_, at, count); }

 private:
  Device device_;
  GridBuilder builder_;
  int64_t particles_ = 0;

 public:
  FixedCapacityLevels places;
};

/// Children, parents, edges and counts of all levels beside those of the hierarchy.
void expect_links_of(const Places& links, const std::vector<Vec3f>& position) {
  const auto hierarchy = sparsegrid::build_hierarchy<3>(position, spacing, {0, 0, 0}, levels);
  EXPECT_EQ(links.number(links.places.fault()), 0);
  EXPECT_EQ(links.number(links.places.particle_count()), static_cast<int32_t>(position.size()));
  EXPECT_EQ(links.number(links.places.pair_count()), 8 * static_cast<int32_t>(position.size()));
  for (std::size_t l = 0; l < levels; ++l) {
    const auto& level = hierarchy.levels[l];
    const LevelLinks placed = links.places.level(static_cast<int>(l));
    ASSERT_EQ(links.number(placed.cell_count), static_cast<int32_t>(level.size()));
    const auto begin = links.numbers(placed.edge_begin, level.size() + 1);
    const auto edges = static_cast<std::size_t>(begin.back());
    ASSERT_EQ(links.number(placed.edge_count), begin.back());
    const auto sender = links.numbers(placed.sender, edges), receiver = links.numbers(placed.receiver, edges),
               slot = links.numbers(placed.slot, edges), octant = links.numbers(placed.octant, level.size());
    EXPECT_EQ(begin.front(), 0);
    std::size_t edge = 0;
    for (std::size_t c = 0; c < level.size(); ++c) {
      ASSERT_EQ(octant[c], level.octant[c]);
      ASSERT_EQ(begin[c], static_cast<int32_t>(edge));
      for (std::size_t k = 0; k < 6; ++k) {
        if (level.neighbor[c][k] < 0) continue;
        ASSERT_EQ(sender[edge], level.neighbor[c][k]);
        ASSERT_EQ(receiver[edge], static_cast<int32_t>(c));
        ASSERT_EQ(slot[edge++], static_cast<int32_t>(k));
      }
    }
    ASSERT_EQ(edge, edges);
    if (l + 1 == levels) continue;
    const std::size_t parents = hierarchy.levels[l + 1].size();
    const auto parent = links.numbers(placed.parent, level.size()), child = links.numbers(placed.child, level.size()),
               child_begin = links.numbers(placed.child_begin, parents + 1);
    EXPECT_EQ(child_begin.front(), 0);
    ASSERT_EQ(child_begin.back(), static_cast<int32_t>(level.size()));
    for (std::size_t c = 0; c < level.size(); ++c) ASSERT_EQ(parent[c], level.parent[c]);
    for (std::size_t p = 0; p < parents; ++p)
      for (int32_t i = child_begin[p]; i < child_begin[p + 1]; ++i)
        ASSERT_EQ(level.parent[static_cast<std::size_t>(child[static_cast<std::size_t>(i)])], static_cast<int32_t>(p));
  }
}

void expect_placed_links(Device device) {
  Places links(device);
  const std::vector<Vec3f> spread = cloud(1, 300, 0.9), gathered = cloud(2, 40, 0.2);
  const LevelCapacity capacity = LevelCapacity::for_counts(links.build(spread));
  links.places.prepare(capacity);
  for (const auto& position : {spread, gathered, spread}) {
    EXPECT_TRUE(capacity.holds(links.build(position)));
    links.place();
    expect_links_of(links, position);
  }
}

void expect_fault_without_room(Device device) {
  Places links(device);
  const LevelCapacity capacity = LevelCapacity::for_counts(links.build(cloud(2, 4, 0.1)));
  links.places.prepare(capacity);
  const auto expect_nothing = [&] {
    links.place();
    EXPECT_EQ(links.number(links.places.fault()), 1);
    EXPECT_EQ(links.number(links.places.particle_count()), 0);
    EXPECT_EQ(links.number(links.places.pair_count()), 0);
    for (int l = 0; l < levels; ++l) {
      EXPECT_EQ(links.number(links.places.level(l).cell_count), 0);
      EXPECT_EQ(links.number(links.places.level(l).edge_count), 0);
    }
  };
  EXPECT_FALSE(capacity.holds(links.build(cloud(1, 300, 0.9))));
  expect_nothing();
  std::vector<Vec3f> outside = cloud(2, 4, 0.1);
  outside[2][1] = 3;
  links.build(outside);
  expect_nothing();
}

TEST(FixedCapacityLevels, HoldTheLinksOfTheGrid) { expect_placed_links(Device::cpu); }
TEST(FixedCapacityLevels, HoldTheLinksOfTheGridOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_placed_links(Device::cuda);
}
TEST(FixedCapacityLevels, HaveNoCellsWhereTheyDoNotFit) { expect_fault_without_room(Device::cpu); }
TEST(FixedCapacityLevels, HaveNoCellsWhereTheyDoNotFitOnTheGpu) {
  GRAUPEL_NEEDS_GPU();
  expect_fault_without_room(Device::cuda);
}

}  // namespace
}  // namespace graupel::graph
