// Loops over the columns of padded rows (nn/linear.h: a multiple of 32 wide, 64-byte aligned), written so that the
// compiler turns them into vector instructions.
#pragma once

#include <algorithm>

#include "nn/activation.h"

namespace graupel::nn {

/// body(c) for every column; iterations must be independent.
template <typename Body>
inline void each_column(int width, const Body& body) {
#pragma omp simd
  for (int c = 0; c < width; ++c) body(c);
}

inline void clear_row(float* y, int width) { std::fill(y, y + width, 0.0f); }

/// y += x.
inline void add_row(float* y, const float* x, int width) {
  each_column(width, [=](int c) { y[c] += x[c]; });
}

/// y += s x.
inline void add_scaled_row(float* y, float s, const float* x, int width) {
  each_column(width, [=](int c) { y[c] += s * x[c]; });
}

/// y = leaky_relu(y).
inline void activate_row(float* y, int width, float slope = leaky_slope) {
  each_column(width, [=](int c) { y[c] = leaky_relu(y[c], slope); });
}

/// y = leaky_relu(a + b), leaky_relu(a + b + c); y may be one of them.
inline void activate_sum(float* y, const float* a, const float* b, int width, float slope = leaky_slope) {
  each_column(width, [=](int i) { y[i] = leaky_relu(a[i] + b[i], slope); });
}
inline void activate_sum(float* y, const float* a, const float* b, const float* c, int width,
                         float slope = leaky_slope) {
  each_column(width, [=](int i) { y[i] = leaky_relu(a[i] + b[i] + c[i], slope); });
}

inline float sum_of_squares(const float* x, int width) {
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (int c = 0; c < width; ++c) sum += x[c] * x[c];
  return sum;
}

}  // namespace graupel::nn
