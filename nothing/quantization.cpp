#include "nn/quantization.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/system/error.h"
#include "nn/number_width.h"

namespace graupel::nn {

namespace {

constexpr float largest = 127;  // -128 is not used: the range is symmetric

std::string scales_of(const std::string& name) { return name + ".scale"; }

bool is_matrix_of_a_network(const std::string& name, const Tensor& tensor) {
  return tensor.dtype != DType::i64 && tensor.dtype != DType::i32 && tensor.dtype != DType::u8 &&
         tensor.shape.size() == 2 && tensor.count() > 0 && name.ends_with(".weight");
}

struct Quantized {
  Tensor integers, scales;
};

Quantized quantize_rows(const Tensor& matrix) {
  const std::vector<float> values = matrix.as_float();
  const auto rows = static_cast<std::size_t>(matrix.shape[0]), columns = static_cast<std::size_t>(matrix.shape[1]);
  std::vector<float> scales(rows);
  Tensor integers{.dtype = DType::i8, .shape = matrix.shape, .bytes = std::vector<std::byte>(values.size())};
  for (std::size_t r = 0; r < rows; ++r) {
    const float* row = values.data() + r * columns;
    float peak = 0;
    for (std::size_t c = 0; c < columns; ++c) peak = std::max(peak, std::abs(row[c]));
    scales[r] = peak / largest;
    for (std::size_t c = 0; c < columns && peak > 0; ++c)
      integers.bytes[r * columns + c] = static_cast<std::byte>(static_cast<int8_t>(std::lround(row[c] / scales[r])));
  }
  return {std::move(integers), Tensor::from_float(scales, {matrix.shape[0]})};
}

}  // namespace

void quantize_matrices(Weights& weights) {
  std::map<std::string, Tensor> matrices;
  for (auto& [name, tensor] : weights.tensors)
    if (is_matrix_of_a_network(name, tensor)) matrices[name] = std::move(tensor);
  if (matrices.empty())
    throw ConfigError("'" + weights.file + "' has no matrices of a network to quantize. Use --numbers f16 or bf16");
  for (const auto& [name, matrix] : matrices) weights.tensors.erase(name);
  set_number_width(weights, "f16");
  for (const auto& [name, matrix] : matrices) {
    for (const float value : matrix.as_float())
      if (!std::isfinite(value))
        throw ConfigError("tensor '" + name + "' of '" + weights.file + "' is not finite. Take an earlier checkpoint");
    Quantized quantized = quantize_rows(matrix);
    weights.tensors[name] = std::move(quantized.integers);
    weights.tensors[scales_of(name)] = std::move(quantized.scales);
  }
}

void expand_quantized(Weights& weights) {
  std::vector<std::string> names;
  for (const auto& [name, tensor] : weights.tensors)
    if (tensor.dtype == DType::i8) names.push_back(name);
  for (const std::string& name : names) {
    Tensor& tensor = weights.tensors.at(name);
    if (tensor.shape.size() != 2)
      throw InputError("'" + weights.file + "': tensor '" + name +
                       "' is in 8 bits and no matrix. Export the file again with `graupel convert`");
    const std::vector<float> scales = weights.get(scales_of(name), {tensor.shape[0]});
    std::vector<float> values(tensor.bytes.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = scales[i / static_cast<std::size_t>(tensor.shape[1])] *
                  static_cast<float>(static_cast<int8_t>(tensor.bytes[i]));
    tensor = Tensor::from_float(values, tensor.shape);
    weights.tensors.erase(scales_of(name));
  }
}

}  // namespace graupel::nn
