// Vectors of floats as wide as the registers of the instruction set that a file is compiled for, on GCC's vector types,
// and columns of rows in them. For kernels.cpp alone: everything here has internal linkage and is inlined, so that no
// code for one processor can be linked into a program for another.
#pragma once

#include "nn/row_kernels.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"  // no vector crosses a call
#endif

#define GRAUPEL_ROWS [[gnu::always_inline]] static inline

namespace graupel::nn {
namespace {

#if defined(__AVX512F__)
constexpr int lanes = 16;
#elif defined(__AVX__)
constexpr int lanes = 8;
#else
constexpr int lanes = 4;
#endif
constexpr int vectors_of_panel = panel / lanes;
typedef float Lanes __attribute__((vector_size(lanes * sizeof(float)), may_alias));
typedef uint32_t Words __attribute__((vector_size(lanes * sizeof(float)), may_alias));

// Loops are unrolled by word: GCC would copy whole arrays through memory in pieces of other widths, and wait for them.

GRAUPEL_ROWS Lanes& lanes_at(float* x) { return *reinterpret_cast<Lanes*>(x); }
GRAUPEL_ROWS const Lanes& lanes_at(const float* x) { return *reinterpret_cast<const Lanes*>(x); }

/// Columns [column, column + vectors * lanes) of a row of floats; `column` and `vectors * lanes` are whole panels.
template <int vectors>
GRAUPEL_ROWS void load_columns(const float* row, int column, Lanes (&x)[vectors]) {
#pragma GCC unroll 8
  for (int v = 0; v < vectors; ++v) x[v] = lanes_at(row + column + v * lanes);
}
/// Of a packed row.
template <int vectors>
GRAUPEL_ROWS void load_columns(const uint32_t* row, int column, Lanes (&x)[vectors]) {
  constexpr int half = vectors_of_panel / 2;
#pragma GCC unroll 4
  for (int p = 0; p < vectors / vectors_of_panel; ++p)
#pragma GCC unroll 4
    for (int v = 0; v < half; ++v) {
      const Words words = *reinterpret_cast<const Words*>(row + words_of<uint32_t>(column + p * panel) + v * lanes);
      x[p * vectors_of_panel + v] = reinterpret_cast<Lanes>(words << 16);
      x[p * vectors_of_panel + half + v] = reinterpret_cast<Lanes>(words & 0xffff0000u);
    }
}

}  // namespace
}  // namespace graupel::nn
