// Rows of bf16 numbers for tests of the kernels over them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "graph/cuda/fused_mlp/row_layers.h"
#include "nn/weights.h"

namespace graupel::graph {

inline double from_bf16(uint16_t x) { return static_cast<double>(nn::float_from_bf16(x)); }

/// Uniform in [-1, 1).
inline std::vector<float> random_numbers(uint64_t seed, std::size_t n) {
  const Random random(seed, RandomPurpose::test);
  std::vector<float> numbers(n);
  for (std::size_t i = 0; i < n; ++i) numbers[i] = static_cast<float>(random.uniform(i, 0, -1, 1));
  return numbers;
}
/// [rows, 128]
inline std::vector<uint16_t> random_rows(uint64_t seed, int64_t rows) {
  std::vector<uint16_t> numbers;
  for (const float x : random_numbers(seed, static_cast<std::size_t>(rows * layer_width)))
    numbers.push_back(nn::bf16_from_float(x));
  return numbers;
}

}  // namespace graupel::graph
