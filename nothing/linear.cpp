#include "nn/linear.h"

#include <algorithm>

#include "nn/bf16_gemm.h"
#include "nn/row_kernels.h"
#include "nn/weights.h"

namespace graupel::nn {

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

MatrixExtensionLayer Linear::on_units() const {
  return {tiles_.size() > 0 && uses_bf16_gemm() ? tiles_.data() : nullptr, bias_.data(), in_, width()};
}

void Linear::apply(const float* x, int64_t x_stride, int64_t rows, float* y, int64_t y_stride) const {
  if (tiles_.size() > 0 && uses_bf16_gemm())
    return multiply_on_extension(x, x_stride, rows, in_, tiles_.data(), bias_.data(), width(), y, y_stride);
  for (int o = 0; o < width(); o += panel)
    row_kernels().multiply(x, x_stride, rows, in_, weight_.data() + o * in_, bias_.data() + o, y + o, y_stride);
}

}  // namespace graupel::nn
