#include "nn/number_width.h"

#include <cmath>

#include "core/system/error.h"
#include "nn/quantization.h"

namespace graupel::nn {

void set_number_width(Weights& weights, const std::string& numbers, const std::vector<std::string>& keep) {
  if (numbers == "i8") return quantize_matrices(weights, keep);
  if (!keep.empty()) throw ConfigError("--keep goes with i8 (" + numbers + "). Leave it out");
  const std::map<std::string, DType> types = {{"f32", DType::f32}, {"f16", DType::f16}, {"bf16", DType::bf16}};
  const auto type = types.find(numbers);
  if (type == types.end())
    throw ConfigError("there are no numbers '" + numbers + "' (allowed: f32, f16, bf16, i8). Use one of these");
  for (auto& [name, tensor] : weights.tensors) {
    if (tensor.dtype == DType::i64 || tensor.dtype == DType::i32 || tensor.dtype == DType::i8 ||
        tensor.dtype == DType::u8)
      continue;
    tensor = Tensor::from_float(tensor.as_float(), tensor.shape, type->second);
    for (const float value : tensor.as_float())
      if (!std::isfinite(value))
        throw ConfigError("tensor '" + name + "' of '" + weights.file + "' has a number that " + numbers +
                          " cannot hold. Use --numbers bf16 or f32");
  }
}

}  // namespace graupel::nn
