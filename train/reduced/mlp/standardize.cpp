#include "train/reduced/mlp/standardize.h"

#include <cmath>

namespace graupel::train {

rom::Standardization standardization_of(const std::vector<float>& values, std::size_t width) {
  std::vector<double> sum(width, 0), sum2(width, 0);
  const std::size_t rows = values.size() / width;
  const auto count = static_cast<double>(rows);
  for (std::size_t i = 0; i < values.size(); ++i) sum[i % width] += static_cast<double>(values[i]);
  rom::Standardization s;
  for (std::size_t c = 0; c < width; ++c) s.shift.push_back(sum[c] / count);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double d = static_cast<double>(values[i]) - s.shift[i % width];
    sum2[i % width] += d * d;
  }
  for (std::size_t c = 0; c < width; ++c) {
    const double deviation = std::sqrt(sum2[c] / count);
    s.scale.push_back(deviation < 1e-12 ? 1 : 1 / deviation);
  }
  return s;
}

void standardize(std::vector<float>& values, const rom::Standardization& s) {
  const std::size_t width = s.shift.size();
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>((static_cast<double>(values[i]) - s.shift[i % width]) * s.scale[i % width]);
}

rom::Standardization inverse_scale(rom::Standardization s) {
  for (double& scale : s.scale) scale = 1 / scale;
  return s;
}

}  // namespace graupel::train
