// Random numbers and rounding for the tests of networks over rows (graph/cuda/persistent/persistent_layers.h).
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "graph/cuda/fused_mlp/row_layers.h"
#include "nn/weights.h"

namespace graupel::graph {

inline constexpr int h = layer_width;
using Numbers = std::vector<float>;

inline float rounded(float x) { return nn::float_from_bf16(nn::bf16_from_float(x)); }
inline float activated(float x) { return std::max(x, 0.01f * x); }

class Draws {
 public:
  explicit Draws(uint64_t seed) : random_(seed, RandomPurpose::test) {}
  Numbers numbers(int64_t n, double half_width, double middle = 0) {
    Numbers all(static_cast<std::size_t>(n));
    for (float& x : all) x = static_cast<float>(random_.uniform(draw_++, 0, middle - half_width, middle + half_width));
    return all;
  }
  Numbers rounded_numbers(int64_t n, double half_width) {
    Numbers all = numbers(n, half_width);
    for (float& x : all) x = rounded(x);
    return all;
  }
  /// -1 for about a quarter where `some_missing`.
  std::vector<int32_t> links(int64_t n, int64_t rows, bool some_missing) {
    std::vector<int32_t> all(static_cast<std::size_t>(n));
    for (int32_t& x : all) {
      x = static_cast<int32_t>(
          random_.uniform(draw_++, 0, some_missing ? -static_cast<double>(rows) / 3 : 0.0, static_cast<double>(rows)));
      x = std::min(x, static_cast<int32_t>(rows - 1));
      if (x < 0) x = -1;
    }
    return all;
  }

 private:
  Random random_;
  uint64_t draw_ = 0;
};

}  // namespace graupel::graph
