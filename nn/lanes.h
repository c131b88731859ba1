// A vector of floats as wide as the processor's: GCC and Clang vector extensions, one type for every instruction set.
// And rows of bf16 numbers for it, in words of 32 bits: word i of a panel of 32 columns has column i in its lower half
// and column i + 16 in its upper one, so that either is a float after one instruction.
#pragma once

#include <cstdint>
#include <type_traits>

namespace graupel::nn {

#ifdef __AVX512F__
inline constexpr int lanes = 16;
#else
inline constexpr int lanes = 8;
#endif
/// Columns that padded rows are made of (nn/linear.h, padded_width).
inline constexpr int panel = 32;
typedef float Lanes __attribute__((vector_size(lanes * sizeof(float)), may_alias));
typedef uint32_t Words __attribute__((vector_size(lanes * sizeof(float)), may_alias));

/// Words that `width` columns take: floats, or packed.
template <typename Word>
constexpr int64_t words_of(int64_t width) {
  return std::is_same_v<Word, float> ? width : width / 2;
}

// Loops are unrolled by word: GCC would copy whole arrays through memory in pieces of other widths, and wait for them.

/// Columns [column, column + vectors * lanes) of a row of floats; `column` and `vectors * lanes` are whole panels.
template <int vectors>
inline void load_columns(const float* row, int column, Lanes (&x)[vectors]) {
#pragma GCC unroll 8
  for (int v = 0; v < vectors; ++v) x[v] = *reinterpret_cast<const Lanes*>(row + column + v * lanes);
}
/// Of a packed row.
template <int vectors>
inline void load_columns(const uint32_t* row, int column, Lanes (&x)[vectors]) {
  constexpr int of_panel = panel / lanes, half = of_panel / 2;
#pragma GCC unroll 4
  for (int p = 0; p < vectors / of_panel; ++p)
#pragma GCC unroll 2
    for (int v = 0; v < half; ++v) {
      const Words words = *reinterpret_cast<const Words*>(row + words_of<uint32_t>(column + p * panel) + v * lanes);
      x[p * of_panel + v] = reinterpret_cast<Lanes>(words << 16);
      x[p * of_panel + half + v] = reinterpret_cast<Lanes>(words & 0xffff0000u);
    }
}

}  // namespace graupel::nn
