// What is done column by column with padded rows (nn/linear.h: a multiple of 32 wide, 64-byte aligned).
#pragma once

#include <algorithm>

#include "nn/activation.h"
#include "nn/row_kernels.h"

namespace graupel::nn {

inline void clear_row(float* y, int width) { std::fill(y, y + width, 0.0f); }

/// y += s x.
inline void add_scaled_row(float* y, float s, const float* x, int width) { row_kernels().add_scaled(y, s, x, width); }

/// y += a x + b x' + c x''.
inline void add_three_rows(float* y, const float (&factor)[3], const float* const (&x)[3], int width) {
  row_kernels().add_three(y, factor, x, width);
}

/// y = leaky_relu(y).
inline void activate_row(float* y, int width, float slope = leaky_slope) {
  row_kernels().activate(y, y, nullptr, nullptr, width, slope);
}

/// y = leaky_relu(a + b), leaky_relu(a + b + c); y may be one of them.
inline void activate_sum(float* y, const float* a, const float* b, int width, float slope = leaky_slope) {
  row_kernels().activate(y, a, b, nullptr, width, slope);
}
inline void activate_sum(float* y, const float* a, const float* b, const float* c, int width,
                         float slope = leaky_slope) {
  row_kernels().activate(y, a, b, c, width, slope);
}

inline float sum_of_squares(const float* x, int width) { return row_kernels().sum_of_squares(x, width); }

/// y = [base +] s gamma y + t beta.
inline void scale_sum(float* y, float s, const float* gamma, float t, const float* beta, int width,
                      const float* base = nullptr) {
  row_kernels().scale_sum(y, s, gamma, t, beta, base, width);
}

}  // namespace graupel::nn
