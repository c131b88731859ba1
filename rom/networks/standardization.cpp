#include "rom/networks/standardization.h"

#include <algorithm>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

std::vector<double> in_f32(const std::vector<double>& values) {
  std::vector<double> result;
  result.reserve(values.size());
  for (const double value : values) result.push_back(static_cast<double>(static_cast<float>(value)));
  return result;
}

}  // namespace

Standardization rounded(const Standardization& s) { return {in_f32(s.shift), in_f32(s.scale)}; }

Standardization load_standardization(const nn::Weights& weights, const std::string& prefix, int count) {
  const std::vector<float> shift = weights.get(prefix + ".shift", {count}),
                           scale = weights.get(prefix + ".scale", {count});
  if (std::find(scale.begin(), scale.end(), 0.0f) != scale.end())
    throw InputError("'" + weights.file + "': tensor '" + prefix +
                     ".scale' holds a 0 (allowed: other numbers). Train the model again");
  return {{shift.begin(), shift.end()}, {scale.begin(), scale.end()}};
}

void store_standardization(nn::Weights& weights, const std::string& prefix, const Standardization& s) {
  const auto tensor = [](const std::vector<double>& values) {
    return nn::Tensor::from_float({values.begin(), values.end()}, {static_cast<int64_t>(values.size())});
  };
  weights.tensors[prefix + ".shift"] = tensor(s.shift);
  weights.tensors[prefix + ".scale"] = tensor(s.scale);
}

}  // namespace graupel::rom
