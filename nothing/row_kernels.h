// The hot loops over padded rows (nn/linear.h: a multiple of 32 wide, 64-byte aligned), compiled once for each
// instruction set (nn/simd/kernels.cpp). The functions of nn/rows.h, nn/activated_sums.h and nn/linear.h call those
// that the program has chosen (core/parallel/instruction_set.h).
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/parallel/instruction_set.h"

namespace graupel::nn {

/// Columns that padded rows are made of (nn/linear.h, padded_width).
inline constexpr int panel = 32;

/// Words that `width` columns take: floats, or packed bf16 numbers. Word i of a packed panel of 32 columns has column i
/// in its lower half and column i + 16 in its upper one, so that either is a float after one instruction.
template <typename Word>
constexpr int64_t words_of(int64_t width) {
  return std::is_same_v<Word, float> ? width : width / 2;
}

/// What one row adds to a sum of activations; Word: float, or uint32_t of packed rows.
template <typename Word>
struct ActivatedRow {
  const Word* row;
  const float* table;
  float weight;
};

struct RowKernels {
  /// y = bias + x W^T for 32 columns of y; weight [in][32]. Row r of x is x + r x_stride.
  void (*multiply)(const float* x, int64_t x_stride, int64_t rows, int in, const float* weight, const float* bias,
                   float* y, int64_t y_stride);

  /// sum += sum over i < n of weight leaky_relu(row + table).
  void (*add_activated)(int width, int n, const ActivatedRow<float>* rows, float* sum);
  void (*add_activated_packed)(int width, int n, const ActivatedRow<uint32_t>* rows, float* sum);
  /// sum = sum over i < n of weight leaky_relu(row + table + base).
  void (*sum_activated)(int width, int n, const ActivatedRow<float>* rows, const float* base, float* sum);
  void (*sum_activated_packed)(int width, int n, const ActivatedRow<uint32_t>* rows, const float* base, float* sum);
  void (*sum_activated_over_packed)(int width, int n, const ActivatedRow<uint32_t>* rows, const uint32_t* base,
                                    float* sum);

  /// y = leaky_relu(a + b + c, slope); b and c may be null, and y may be one of them.
  void (*activate)(float* y, const float* a, const float* b, const float* c, int width, float slope);
  /// y += s x.
  void (*add_scaled)(float* y, float s, const float* x, int width);
  /// y += a x[0] + b x[1] + c x[2].
  void (*add_three)(float* y, const float (&factor)[3], const float* const (&x)[3], int width);
  float (*sum_of_squares)(const float* x, int width);
  /// y = [y +] s x gamma + beta; y may be x.
  void (*normalize)(float* y, float s, const float* x, const float* gamma, const float* beta, bool onto, int width);
  /// y = [base +] s gamma y + t beta; base may be null.
  void (*scale_sum)(float* y, float s, const float* gamma, float t, const float* beta, const float* base, int width);
};

/// Those of an instruction set that is available.
const RowKernels& row_kernels(InstructionSet set);
/// Those that the program has chosen. Throws ConfigError as instruction_set() does.
inline const RowKernels& row_kernels() {
  static const RowKernels& chosen = row_kernels(instruction_set());
  return chosen;
}

}  // namespace graupel::nn
