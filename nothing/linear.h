// y = x W^T + b over rows, with the weights packed once for a register-tiled kernel.
#pragma once

#include <cstdint>
#include <vector>

#include "core/parallel/buffer.h"
#include "nn/matrix_extension_mlp.h"

namespace graupel::nn {

/// Columns of a row in memory: n rounded up to 32, so that whole vectors can be read and written. Padding holds zeros.
constexpr int padded_width(int n) { return (n + 31) / 32 * 32; }

/// Rows are computed one by one in a fixed order of additions: results depend neither on how many rows are given at
/// once nor on the thread that does it. Calls may run in parallel; each uses one thread. Where bf16 products were asked
/// for (nn/bf16_gemm.h), apply() rounds x and W to bf16.
class Linear {
 public:
  Linear() = default;
  /// W is weight[o * stride + i], o < out, i < in; `bias` has `out` values or none.
  Linear(int out, int in, const float* weight, int stride, const std::vector<float>& bias = {});

  int in() const { return in_; }
  int out() const { return out_; }
  int width() const { return padded_width(out_); }  ///< columns that apply writes
  /// As the units for bf16 take it; without tiles where they are not to be used.
  MatrixExtensionLayer on_units() const;

  /// y = x W^T + b. Row r is x + r x_stride (in() values) and y + r y_stride (width() values, 64-byte aligned).
  void apply(const float* x, int64_t x_stride, int64_t rows, float* y, int64_t y_stride) const;

 private:
  int out_ = 0, in_ = 0;
  Buffer<float> weight_;    ///< [width/32][in][32]
  Buffer<float> bias_;      ///< [width]
  Buffer<uint16_t> tiles_;  ///< of the weights in bf16, where the processor has units for them
};

}  // namespace graupel::nn
