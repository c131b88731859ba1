#include "graph/cuda/persistent/persistent_weights.h"

#include "nn/weights.h"

namespace graupel::graph {

namespace {

/// `at(row, column)`: a number of the matrix.
template <typename At>
void pack(uint16_t* packed, const At& at) {
  for (int warp = 0; warp < 8; ++warp)
    for (int step = 0; step < 8; ++step)
      for (int lane = 0; lane < 32; ++lane)
        for (int word = 0; word < 4; ++word) {
          const PersistentWord from = wide_word(warp, step, lane, word);
          uint16_t* const to = packed + wide_place(warp, step, lane, word);
          for (int i = 0; i < 2; ++i) to[i] = nn::bf16_from_float(at(from.row, from.column + i));
        }
}

}  // namespace

void pack_persistent_tile(const float* weight, int64_t stride, int64_t columns, uint16_t* packed) {
  pack(packed, [&](int row, int column) { return column < columns ? weight[row * stride + column] : 0.0f; });
}

void pack_feature_tiles(const float* weight, int64_t stride, int width, uint16_t* packed) {
  for (int tile = 0; tile < feature_tiles(width); ++tile)
    pack(packed + tile * tile_numbers, [&](int row, int column) {
      const int part = (tile * layer_width + column) / width, feature = (tile * layer_width + column) % width;
      if (part >= feature_parts) return 0.0f;
      const float w = weight[row * stride + feature];
      return part == 2 ? w - nn::float_from_bf16(nn::bf16_from_float(w)) : w;
    });
}

}  // namespace graupel::graph
