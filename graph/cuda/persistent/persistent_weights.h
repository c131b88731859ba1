// Weights in the order in which the kernels of persistent_layers.h read them.
#pragma once

#include <cstdint>
#include <vector>

#include "graph/cuda/fused_mlp/row_layers.h"

namespace graupel::graph {

/// Where a lane's registers take their part of a 128 x 128 matrix from: lane `lane` of warp `warp` reads for step `k`
/// of 16 columns four words (mma.sync m16n8k16's second operand for two blocks of eight results), each of two numbers.
/// The results of a lane's two blocks are four neighbours: 16 warp + 4 (lane % 4) and on.
struct PersistentWord {
  int row, column;  ///< of the first number; the second lies in the next column
};
constexpr PersistentWord wide_word(int warp, int step, int lane, int word) {
  const int result = lane / 4, block = word / 2, half = word % 2;
  return {16 * warp + 4 * (result / 2) + 2 * block + result % 2, 16 * step + 2 * (lane % 4) + 8 * half};
}
/// Its place among the numbers of a packed tile.
constexpr int wide_place(int warp, int step, int lane, int word) {
  return 2 * (((warp * 8 + step) * 32 + lane) * 4 + word);
}

/// Packs W [128, columns], rows `stride` apart; columns from `columns` on are 0.
void pack_persistent_tile(const float* weight, int64_t stride, int64_t columns, uint16_t* packed);

/// Features are multiplied in three parts, so that nothing of them is lost: x W = x_h W_h + x_l W_h + x_h W_l with
/// x_h = bf16(x), x_l = bf16(x - x_h). Packs the matrix [W_h, W_h, W_l] of W [128, width] as one or two tiles.
constexpr int feature_parts = 3;
constexpr int feature_tiles(int width) { return (feature_parts * width + layer_width - 1) / layer_width; }
void pack_feature_tiles(const float* weight, int64_t stride, int width, uint16_t* packed);

}  // namespace graupel::graph
