// Compiled for the units whatever the rest is compiled for: nothing but plain functions here.
#include "nn/bf16_gemm.h"

#include <atomic>

#ifdef __AMX_BF16__
#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "nn/matrix_extension_tiles.h"
#endif

namespace graupel::nn {

namespace {

std::atomic<Bf16Extension> in_use{Bf16Extension::none};

#ifdef __AMX_BF16__

constexpr int most_inputs = 512;

/// The processor's units and registers, and the system's leave to use them (matrix units, Linux: ARCH_REQ_XCOMP_PERM).
Bf16Extension look_for_units() {
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||
      !__builtin_cpu_supports("avx512bf16"))
    return Bf16Extension::none;
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return Bf16Extension::vectors;
  const bool amx_bf16 = d >> 22 & 1, amx_tile = d >> 24 & 1;
  constexpr long request_permission = 0x1023, tile_data = 18;
  return amx_bf16 && amx_tile && ::syscall(SYS_arch_prctl, request_permission, tile_data) == 0 ? Bf16Extension::matrices
                                                                                               : Bf16Extension::vectors;
}

/// Rows as bf16, [2 side][in]; rows beyond the last are 0, the second side of them only where they are needed.
void round_rows(const float* x, int64_t x_stride, int64_t rows, int in, uint16_t* out) {
  for (int r = 0; r < (rows > side ? 2 * side : side); ++r)
    for (int i = 0; i < in; i += inputs) {
      __m512bh both = {};
      if (r < rows)
        both = _mm512_cvtne2ps_pbh(_mm512_loadu_ps(x + r * x_stride + i + 16), _mm512_loadu_ps(x + r * x_stride + i));
      _mm512_store_si512(out + r * in + i, reinterpret_cast<__m512i>(both));
    }
}

void copy_block(const float* from, int64_t rows, float* to, int64_t to_stride) {
  for (int64_t r = 0; r < rows; ++r)
    for (int half = 0; half < 2; ++half)
      _mm512_storeu_ps(to + r * to_stride + half * side, _mm512_load_ps(from + r * 2 * side + half * side));
}

template <typename Units>
void multiply(const float* x, int64_t x_stride, int64_t rows, int in, const uint16_t* tiles, const float* bias,
              int width, float* y, int64_t y_stride) {
  alignas(64) uint16_t rounded[2 * side * most_inputs];
  alignas(64) float last[2 * side * 2 * side];
  Units units;
  for (int64_t first = 0; first < rows; first += 2 * side) {
    const int64_t here = rows - first < 2 * side ? rows - first : 2 * side;
    const bool two = here > side;  // tiles of rows
    round_rows(x + first * x_stride, x_stride, here, in, rounded);
    for (int o = 0; o < width; o += 2 * side) {
      units.multiply_block(tiles, bias, rounded, in, in, o, two);
      const bool whole = here == 2 * side;
      units.store_block(whole ? y + first * y_stride + o : last, whole ? y_stride : 2 * side, two);
      if (!whole) copy_block(last, here, y + first * y_stride + o, y_stride);
    }
  }
}
#endif

}  // namespace

#ifdef __AMX_BF16__
Bf16Extension available_bf16_units() {
  static const Bf16Extension units = look_for_units();
  return units;
}

void multiply_on_extension(const float* x, int64_t x_stride, int64_t rows, int in, const uint16_t* tiles,
                           const float* bias, int width, float* y, int64_t y_stride) {
  const auto multiply_here =
      bf16_units_in_use() == Bf16Extension::matrices ? multiply<AmxTiles> : multiply<Avx512Bf16Tiles>;
  multiply_here(x, x_stride, rows, in, tiles, bias, width, y, y_stride);
}

Bf16Extension fastest_bf16_units() {
  __builtin_cpu_init();
  const Bf16Extension best = available_bf16_units();
  return best == Bf16Extension::vectors && !__builtin_cpu_is("amd") ? Bf16Extension::none : best;
}
#else
Bf16Extension available_bf16_units() { return Bf16Extension::none; }
Bf16Extension fastest_bf16_units() { return Bf16Extension::none; }
void multiply_on_extension(const float*, int64_t, int64_t, int, const uint16_t*, const float*, int, float*, int64_t) {}
#endif

void use_bf16_units(Bf16Extension units) {
  const Bf16Extension best = available_bf16_units();
  in_use.store(units < best ? units : best, std::memory_order_relaxed);
}
Bf16Extension bf16_units_in_use() { return in_use.load(std::memory_order_relaxed); }

}  // namespace graupel::nn
