// A tile of rows through a fully connected network on the processor's units for bf16 (nn/bf16_gemm.h), 32 rows
// after the other from end to end: what lies between the products stays in registers and in the first-level cache.
#pragma once

#include <cstdint>

namespace graupel::nn {

/// y = x W^T + b as Linear has it for the units; `tiles` null: there is no such layer.
struct MatrixExtensionLayer {
  const uint16_t* tiles = nullptr;
  const float* bias = nullptr;
  int in = 0, width = 0;
};

/// hidden = leaky_relu(first(x)), or x where there is no first layer; f = norm(second(hidden)); next(f) is wanted, too.
struct MatrixExtensionMlp {
  MatrixExtensionLayer first, second, next;
  const float *gamma = nullptr, *beta = nullptr;
  int out = 0;  ///< numbers of a latent, for the norm's mean
};

/// Latents have second.width columns; all rows are 64-byte aligned.
struct ChainRows {
  int64_t rows = 0;
  const float* input = nullptr;  ///< of the first layer, or activated
  int64_t input_stride = 0;
  float* latent = nullptr;
  bool with_latent = false;  ///< the first layer's input is [input, latent], and the result is added to the latent
  bool add = false;          ///< the result is added to the latent
  float* next = nullptr;     ///< rows of next.width columns,
  uint32_t* packed_next = nullptr;  ///< or packed ones (nn/row_kernels.h)
};

/// Only where has_bf16_units(), and suits_bf16_units() all layers' inputs, at most most_chain_width columns.
inline constexpr int most_chain_width = 256;
void apply_chain_on_units(const MatrixExtensionMlp& chain, const ChainRows& rows);

/// Rows of `width` columns (whole panels) packed as nn/row_kernels.h has them, rounded to bf16. Only where
/// has_bf16_units().
void pack_rows(const float* x, int64_t rows, int width, uint32_t* packed);

}  // namespace graupel::nn
