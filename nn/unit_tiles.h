// Blocks of 32 rows and 32 outputs on the matrix units: their sums lie in four tiles of 16 x 16; two tiles of x and two
// of W add 32 inputs' products to all four. Only for files that are compiled for the units.
#pragma once

#include <immintrin.h>

#include <cstdint>

namespace graupel::nn {
namespace {

constexpr int side = 16, inputs = 32;

struct TileConfig {
  uint8_t palette = 1, start_row = 0, reserved[14] = {};
  uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  uint8_t rows[16] = {side, side, side, side, side, side, side, side};
};
static_assert(sizeof(TileConfig) == 64);

inline void begin_tiles() {
  alignas(64) const TileConfig config;
  _tile_loadconfig(&config);
}
inline void end_tiles() { _tile_release(); }

/// Outputs [o, o + 32) of 16 or, with `two`, 32 rows of x (bf16): tiles 0 to 3 = bias + x W^T. `tiles` as bf16_place.
inline void multiply_block(const uint16_t* tiles, const float* bias, const uint16_t* x, int x_stride, int in, int o,
                           bool two) {
  const int64_t b_tile = int64_t{side} * inputs, b_column = b_tile * (in / inputs);
  const uint16_t* const b = tiles + o / side * b_column;
  // A stride of 0 gives every row the bias.
  _tile_loadd(0, bias + o, 0);
  _tile_loadd(1, bias + o + side, 0);
  if (two) {
    _tile_loadd(2, bias + o, 0);
    _tile_loadd(3, bias + o + side, 0);
  }
  for (int k = 0; k < in / inputs; ++k) {
    _tile_loadd(4, x + k * inputs, x_stride * 2);
    _tile_loadd(6, b + k * b_tile, 64);
    _tile_loadd(7, b + b_column + k * b_tile, 64);
    _tile_dpbf16ps(0, 4, 6);
    _tile_dpbf16ps(1, 4, 7);
    if (!two) continue;
    _tile_loadd(5, x + int64_t{side} * x_stride + k * inputs, x_stride * 2);
    _tile_dpbf16ps(2, 5, 6);
    _tile_dpbf16ps(3, 5, 7);
  }
}

inline void store_block(float* y, int64_t y_stride, bool two) {
  _tile_stored(0, y, y_stride * 4);
  _tile_stored(1, y + side, y_stride * 4);
  if (!two) return;
  _tile_stored(2, y + side * y_stride, y_stride * 4);
  _tile_stored(3, y + side * y_stride + side, y_stride * 4);
}

}  // namespace
}  // namespace graupel::nn
