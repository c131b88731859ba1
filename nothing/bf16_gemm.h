// Matrix products in bf16 with f32 sums, on processors with units for them: matrix units (Intel AMX), some six times as
// fast as f32, or vector units (AVX512_BF16). These have twice the rate of f32 on AMD's processors since Zen 4 by the
// tables of instructions, on Intel's 0.57 of it (Xeon with AMX, two cores: 227 to 401 GFLOP/s).
#pragma once

#include <cstdint>

namespace graupel::nn {

enum class Bf16Extension { none, vectors, matrices };
/// The best that this processor and its system have. With matrix units it has the vector units, too.
Bf16Extension available_bf16_units();
bool has_bf16_units();
/// Those that are faster than f32: matrix units, and vector units of AMD.
Bf16Extension fastest_bf16_units();

/// With which units Linear::apply multiplies operands rounded to bf16, for the whole process; none: in f32. None until
/// they are asked for; no better ones than are available.
void use_bf16_units(Bf16Extension units);
Bf16Extension bf16_units_in_use();
void set_bf16_gemm(bool use);
bool uses_bf16_gemm();
/// What programs begin with: the units that are faster than f32, unless the environment variable GRAUPEL_PRODUCTS says
/// f32, bf16 (the best units) or bf16-vectors. Throws ConfigError for another value, and for units that are not there.
void choose_gemm_precision();
/// "f32 products", "bf16 products on vector units" or "bf16 products on matrix units".
const char* gemm_precision_name();

/// Inputs that the units take: whole tiles, and enough of them.
constexpr bool suits_bf16_units(int in) { return in % 32 == 0 && in >= 64 && in <= 512; }

/// Place of W[o][i] among tiles of 16 outputs and 32 inputs, [width / 16][in / 32][16 pairs of inputs][16 outputs][2].
constexpr int64_t bf16_place(int o, int i, int in) {
  const int64_t tile = int64_t{o / 16} * (in / 32) + i / 32;
  return tile * 512 + i % 32 / 2 * 32 + o % 16 * 2 + i % 2;
}

/// y = x W^T + b, as Linear::apply; `tiles` holds W in bf16, `width` outputs (a multiple of 32). Only where
/// has_bf16_units() and suits_bf16_units(in).
void multiply_on_extension(const float* x, int64_t x_stride, int64_t rows, int in, const uint16_t* tiles,
                           const float* bias, int width, float* y, int64_t y_stride);

}  // namespace graupel::nn
