// The steps of a grid in one launch, by the threads of all blocks in any order between two barriers, give the grid of
// the portable way.
#include "graph/topology/grid_at_once.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <utility>

#include "tests/graph/topology/grid_case.h"

namespace graupel::graph {
namespace {

constexpr int most_threads = 512;

/// A block of a launch (grid::BuildAtOnce), whose threads take turns in an order of their own.
class HostBlock {
 public:
  template <typename T>
  using PerThread = std::array<T, most_threads>;

  HostBlock(int64_t index, int64_t count, int threads, std::mt19937& order)
      : index_(index), count_(count), order_(order), turn_(static_cast<std::size_t>(threads)) {
    std::iota(turn_.begin(), turn_.end(), 0);
  }
  int64_t index() const { return index_; }
  int64_t count() const { return count_; }
  int threads() const { return static_cast<int>(turn_.size()); }
  static void wait() {}
  template <typename Body>
  void for_threads(const Body& body) {
    std::shuffle(turn_.begin(), turn_.end(), order_);
    for (const int thread : turn_) body(thread);
  }
  int32_t sum_before(PerThread<int32_t>& value) const {
    int32_t sum = 0;
    for (std::size_t thread = 0; thread < turn_.size(); ++thread) sum += std::exchange(value[thread], sum);
    return sum;
  }
  template <typename Used, typename Of, typename Body>
  void for_bits(int64_t first, int64_t last, const Used& used, const Of& of, const Body& body) const {
    for (int64_t w = last; w-- > first;) {
      if (!used(w)) continue;
      int32_t sum = 0;
      for (int bit = 0; bit < grid::word_bits; ++bit) {
        body(w, bit, sum);
        sum += of(w, bit);
      }
    }
  }

  std::array<uint32_t, most_threads> word{};
  std::array<int32_t, most_threads> cells{}, pairs{};

 private:
  int64_t index_, count_;
  std::mt19937& order_;
  std::vector<int> turn_;
};

struct LaunchSize {
  int64_t blocks;  ///< or more, where there are more words than threads
  int threads;
};

/// What a launch must not read before it has written it.
void spoil(const GridProgram& p) {
  constexpr int32_t nonsense = std::numeric_limits<int32_t>::min() + 12345;
  const int64_t pairs = grid::corners * p.particles;
  for (int32_t* of_pairs : {p.cell, p.place, p.listed, p.pair}) std::fill_n(of_pairs, pairs, nonsense);
  std::fill_n(p.rank, p.words, nonsense);
  std::fill_n(p.link.level_begin, p.link.k.levels + 1, nonsense);
  std::fill_n(p.weight, pairs, std::numeric_limits<float>::quiet_NaN());
  std::fill_n(p.offset, 3 * p.particles, std::numeric_limits<float>::quiet_NaN());
}

GridLaunch launch_on_host(const LaunchSize& size, unsigned seed) {
  return [=](const GridProgram& program, void*) {
    spoil(program);
    std::mt19937 order(seed);
    std::vector<HostBlock> blocks;
    const int64_t count = std::max(size.blocks, (program.words + size.threads - 1) / size.threads);
    for (int64_t b = 0; b < count; ++b) blocks.emplace_back(b, count, size.threads, order);
    using Build = grid::BuildAtOnce<HostBlock>;
    for (void (Build::*part)() : {&Build::mark_cells, &Build::number_cells, &Build::link_cells, &Build::order_pairs}) {
      std::vector<std::size_t> shuffled(blocks.size());
      std::iota(shuffled.begin(), shuffled.end(), std::size_t{0});
      std::shuffle(shuffled.begin(), shuffled.end(), order);
      for (const std::size_t b : shuffled) (Build(program, blocks[b]).*part)();
    }
  };
}

/// From one particle a block to more threads than items, from fewer words than blocks to a block full of words.
constexpr LaunchSize sizes[] = {{1, 512}, {2, 512}, {3, 96}, {13, 512}, {40, 32}, {131, 64}, {132, 512}};

void expect_same(const HostLinks& actual, const HostLinks& expected) {
  ASSERT_EQ(actual.counts.cells, expected.counts.cells);
  ASSERT_EQ(actual.counts.edges, expected.counts.edges);
  EXPECT_EQ(actual.counts.overflow, expected.counts.overflow);
  EXPECT_EQ(actual.coordinate, expected.coordinate);
  EXPECT_EQ(actual.neighbor, expected.neighbor);
  EXPECT_EQ(actual.parent, expected.parent);
  EXPECT_EQ(actual.octant, expected.octant);
  EXPECT_EQ(actual.sender, expected.sender);
  EXPECT_EQ(actual.reverse, expected.reverse);
  EXPECT_EQ(actual.edge_begin, expected.edge_begin);
  EXPECT_EQ(actual.child_begin, expected.child_begin);
  EXPECT_EQ(actual.child, expected.child);
  for (auto i = static_cast<std::size_t>(8 * expected.counts.cells[0]); i < expected.children.size(); ++i)
    ASSERT_EQ(actual.children[i], expected.children[i]);
  EXPECT_EQ(actual.cell, expected.cell);
  EXPECT_EQ(actual.pair_begin, expected.pair_begin);
  EXPECT_EQ(actual.pair, expected.pair);
  for (std::size_t i = 0; i < expected.weight.size(); ++i)
    ASSERT_NEAR(actual.weight[i], expected.weight[i], 5 * offset_rounding);
  for (std::size_t i = 0; i < expected.offset.size(); ++i)
    ASSERT_NEAR(actual.offset[i], expected.offset[i], offset_rounding);
}

class GridAtOnce : public ::testing::TestWithParam<LaunchSize> {};

TEST_P(GridAtOnce, IsThatOfTheCpu) {
  GridBuilder portable(Device::cpu, spacing, levels);
  GridBuilder builder(Device::cpu, spacing, levels, 3, true, launch_on_host(GetParam(), 1));
  const std::vector<Cloud> all = clouds(), dense = {make_cloud(6, 3000, {0, 0, 0}, {0.2, 0.1, 0.2})};
  // Memory that was used for more is used for less, and the other way round.
  for (const std::vector<Cloud>& some : {all, {all[1]}, all, {all[2]}, dense, {all[2], all[0]}})
    expect_same(build_on(Device::cpu, builder, some), build_on(Device::cpu, portable, some));
}

TEST_P(GridAtOnce, LeavesNothingForTheNextOne) {
  GridBuilder portable(Device::cpu, spacing, levels);
  GridBuilder builder(Device::cpu, spacing, levels, 3, true, launch_on_host(GetParam(), 2));
  std::vector<Cloud> all = clouds();
  const auto expect_same_again = [&] {
    expect_same(build_again(Device::cpu, builder, positions_of(all)), build_on(Device::cpu, portable, all));
  };
  expect_same(build_on(Device::cpu, builder, all), build_on(Device::cpu, portable, all));
  const Vec3f inside = all[1].position[7];
  for (const float outside : {1.6f, -3e9f, std::numeric_limits<float>::quiet_NaN()}) {
    all[1].position[7][1] = outside;
    expect_same_again();
    all[1].position[7] = inside;
    expect_same_again();
  }
  for (Vec3f& x : all[0].position) x = all[0].position[0];
  expect_same_again();
}

INSTANTIATE_TEST_SUITE_P(Sizes, GridAtOnce, ::testing::ValuesIn(sizes), [](const auto& size) {
  return std::to_string(size.param.blocks)
      .append("Blocks")
      .append(std::to_string(size.param.threads))
      .append("Threads");
});

TEST(GridAtOnceOrder, OfThreadsDoesNotMatter) {
  const std::vector<Cloud> all = clouds();
  GridBuilder portable(Device::cpu, spacing, levels);
  const HostLinks expected = build_on(Device::cpu, portable, all);
  for (unsigned seed = 0; seed < 40; ++seed) {
    GridBuilder builder(Device::cpu, spacing, levels, 3, true, launch_on_host({7 + seed, 128}, seed));
    expect_same(build_on(Device::cpu, builder, all), expected);
  }
}

}  // namespace
}  // namespace graupel::graph
