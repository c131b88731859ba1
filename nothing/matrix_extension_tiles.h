// Blocks of 32 rows and 32 outputs of x W^T, x and W in bf16, sums in f32, on the units of the processor. Only for
// files that are compiled for the units: every function is a template on them, and is called where they are.
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

/// Matrix units: the sums lie in four tiles of 16 x 16; two tiles of x and two of W add 32 inputs' products to all
/// four.
class AmxTiles {
 public:
  AmxTiles() {
    alignas(64) const TileConfig config;
    _tile_loadconfig(&config);
  }
  ~AmxTiles() { _tile_release(); }
  AmxTiles(const AmxTiles&) = delete;
  AmxTiles& operator=(const AmxTiles&) = delete;

  /// Outputs [o, o + 32) of 16 or, with `two`, 32 rows of x: sums = bias + x W^T. `tiles` as bf16_place.
  void multiply_block(const uint16_t* tiles, const float* bias, const uint16_t* x, int x_stride, int in, int o,
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

  void store_block(float* y, int64_t y_stride, bool two) {
    _tile_stored(0, y, y_stride * 4);
    _tile_stored(1, y + side, y_stride * 4);
    if (!two) return;
    _tile_stored(2, y + side * y_stride, y_stride * 4);
    _tile_stored(3, y + side * y_stride + side, y_stride * 4);
  }
};

/// Vector units: eight rows' sums lie in registers while W's pairs of inputs pass by, then in the first-level cache.
class Avx512Bf16Tiles {
 public:
  void multiply_block(const uint16_t* tiles, const float* bias, const uint16_t* x, int x_stride, int in, int o,
                      bool two) {
    const int64_t b_column = int64_t{side} * in;
    const uint16_t* const b = tiles + o / side * b_column;
    for (int first = 0; first < (two ? 2 * side : side); first += rows) {
      __m512 sum[rows][2];
      for (auto& row : sum)
        for (int half = 0; half < 2; ++half) row[half] = _mm512_loadu_ps(bias + o + half * side);
      for (int k = 0; k < in; k += 2) {
        const __m512i low = _mm512_load_si512(b + k * side), high = _mm512_load_si512(b + b_column + k * side);
#pragma GCC unroll 8
        for (int r = 0; r < rows; ++r) {
          int32_t pair;
          __builtin_memcpy(&pair, x + int64_t{first + r} * x_stride + k, sizeof pair);
          const __m512i both = _mm512_set1_epi32(pair);
          sum[r][0] = _mm512_dpbf16_ps(sum[r][0], reinterpret_cast<const __m512bh&>(both),
                                       reinterpret_cast<const __m512bh&>(low));
          sum[r][1] = _mm512_dpbf16_ps(sum[r][1], reinterpret_cast<const __m512bh&>(both),
                                       reinterpret_cast<const __m512bh&>(high));
        }
      }
      for (int r = 0; r < rows; ++r)
        for (int half = 0; half < 2; ++half) _mm512_store_ps(&sums_[first + r][half * side], sum[r][half]);
    }
  }

  void store_block(float* y, int64_t y_stride, bool two) {
    for (int r = 0; r < (two ? 2 * side : side); ++r)
      for (int half = 0; half < 2; ++half)
        _mm512_storeu_ps(y + r * y_stride + half * side, _mm512_load_ps(&sums_[r][half * side]));
  }

 private:
  static constexpr int rows = 8;
  alignas(64) float sums_[2 * side][2 * side];
};

}  // namespace
}  // namespace graupel::nn
