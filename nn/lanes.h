// A vector of floats as wide as the processor's: GCC and Clang vector extensions, one type for every instruction set.
#pragma once

namespace graupel::nn {

#ifdef __AVX512F__
inline constexpr int lanes = 16;
#else
inline constexpr int lanes = 8;
#endif
/// Columns that padded rows are made of (nn/linear.h, padded_width).
inline constexpr int panel = 32;
typedef float Lanes __attribute__((vector_size(lanes * sizeof(float)), may_alias));

}  // namespace graupel::nn
