// Weights of networks over rows lie where the kernels' lanes take them from.
#include "graph/cuda/persistent/persistent_weights.h"

#include <gtest/gtest.h>

#include <set>
#include <utility>

#include "tests/graph/cuda/persistent_case.h"

namespace graupel::graph {
namespace {

TEST(WideWeights, EveryNumberHasOnePlace) {
  std::set<std::pair<int, int>> seen;
  for (int warp = 0; warp < 8; ++warp)
    for (int step = 0; step < 8; ++step)
      for (int lane = 0; lane < 32; ++lane)
        for (int word = 0; word < 4; ++word) {
          const PersistentWord at = wide_word(warp, step, lane, word);
          seen.insert({at.row, at.column});
          seen.insert({at.row, at.column + 1});
        }
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(h * h));
}

/// The products of mma.sync m16n8k16 by the PTX manual's places of the second operand and of the sums.
TEST(WideWeights, LanesHoldTheResultsThatTheKernelTakesThemFor) {
  Draws draws(1);
  const Numbers weight = draws.rounded_numbers(h * 140, 1), x = draws.numbers(h, 1);
  std::vector<uint16_t> tile(tile_numbers);
  pack_persistent_tile(weight.data() + 3, 140, h, tile.data());
  for (int warp = 0; warp < 8; ++warp)
    for (int block = 0; block < 2; ++block)
      for (int column = 0; column < 8; ++column) {  // of the second operand and of the sums
        float sum = 0;
        for (int step = 0; step < 8; ++step)
          for (int k = 0; k < 16; ++k) {
            const int lane = 4 * column + k % 8 / 2, word = 2 * block + k / 8;
            sum += x[static_cast<std::size_t>(16 * step + k)] *
                   nn::float_from_bf16(tile[static_cast<std::size_t>(wide_place(warp, step, lane, word) + k % 2)]);
          }
        const int sum_lane = column / 2, row = 16 * warp + 4 * sum_lane + 2 * block + column % 2;
        float expected = 0;
        for (int k = 0; k < h; ++k)
          expected += x[static_cast<std::size_t>(k)] * weight[static_cast<std::size_t>(row * 140 + 3 + k)];
        EXPECT_NEAR(sum, expected, 1e-4);
      }
}

TEST(WideWeights, FeaturesLoseNothing) {
  Draws draws(2);
  for (const int width : {28, 61}) {
    const Numbers weight = draws.numbers(h * width, 1), x = draws.numbers(width, 1);
    std::vector<uint16_t> tiles(static_cast<std::size_t>(feature_tiles(width)) * tile_numbers);
    pack_feature_tiles(weight.data(), width, width, tiles.data());
    Numbers sums(h, 0.0f);
    for (int tile = 0; tile < feature_tiles(width); ++tile)
      for (int place = 0; place < tile_numbers; place += 2) {
        const int word = place / 2 % 4, lane = place / 8 % 32, step = place / 256 % 8, warp = place / 2048;
        const PersistentWord at = wide_word(warp, step, lane, word);
        for (int i = 0; i < 2; ++i) {
          const int column = tile * h + at.column + i;
          if (column >= feature_parts * width) continue;
          const float value = x[static_cast<std::size_t>(column % width)], high = rounded(value);
          sums[static_cast<std::size_t>(at.row)] +=
              nn::float_from_bf16(tiles[static_cast<std::size_t>(tile * tile_numbers + place + i)]) *
              (column / width == 1 ? rounded(value - high) : high);
        }
      }
    for (int row = 0; row < h; ++row) {
      float expected = 0;
      for (int k = 0; k < width; ++k)
        expected += weight[static_cast<std::size_t>(row * width + k)] * x[static_cast<std::size_t>(k)];
      EXPECT_NEAR(sums[static_cast<std::size_t>(row)], expected, 1e-3);
    }
  }
}

}  // namespace
}  // namespace graupel::graph
