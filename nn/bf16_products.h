// Matrix products in bf16 with f32 sums, on processors with matrix units (Intel AMX): some ten times as fast as f32.
#pragma once

#include <cstdint>

namespace graupel::nn {

/// Whether this processor and its system have the units.
bool has_bf16_units();

/// Whether Linear::apply rounds its operands to bf16, for the whole process. False until it is asked for, and where
/// there are no units.
void use_bf16_products(bool use);
bool uses_bf16_products();
/// What programs begin with: bf16 where there are units, unless the environment variable GRAUPEL_PRODUCTS says f32.
/// Throws ConfigError for a value that is neither f32 nor bf16, and for bf16 without units.
void choose_products();

/// Inputs that the units take: whole tiles, and enough of them.
constexpr bool suits_bf16_units(int in) { return in % 32 == 0 && in >= 64 && in <= 512; }

/// Place of W[o][i] among tiles of 16 outputs and 32 inputs, [width / 16][in / 32][16 pairs of inputs][16 outputs][2].
constexpr int64_t bf16_place(int o, int i, int in) {
  const int64_t tile = int64_t{o / 16} * (in / 32) + i / 32;
  return tile * 512 + i % 32 / 2 * 32 + o % 16 * 2 + i % 2;
}

/// y = x W^T + b, as Linear::apply; `tiles` holds W in bf16, `width` outputs (a multiple of 32). Only where
/// has_bf16_units() and suits_bf16_units(in).
void multiply_on_units(const float* x, int64_t x_stride, int64_t rows, int in, const uint16_t* tiles, const float* bias,
                       int width, float* y, int64_t y_stride);

}  // namespace graupel::nn
