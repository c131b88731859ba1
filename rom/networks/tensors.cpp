#include "rom/networks/tensors.h"

#include <cstring>

#include "core/system/error.h"

namespace graupel::rom {

namespace {

const nn::Tensor& find(const nn::Weights& weights, const std::string& name) {
  const auto at = weights.tensors.find(name);
  if (at == weights.tensors.end())
    throw InputError("'" + weights.file + "' lacks the tensor '" + name +
                     "' of a reduced-order model. It is damaged or of another version; train it again");
  return at->second;
}

}  // namespace

nn::Tensor index_tensor(const std::vector<int32_t>& values) {
  nn::Tensor tensor;
  tensor.dtype = nn::DType::i32;
  tensor.shape = {static_cast<int64_t>(values.size())};
  tensor.bytes.resize(values.size() * sizeof(int32_t));
  if (!values.empty()) std::memcpy(tensor.bytes.data(), values.data(), tensor.bytes.size());
  return tensor;
}

std::vector<int32_t> get_indices(const nn::Weights& weights, const std::string& name) {
  const nn::Tensor& tensor = find(weights, name);
  if (tensor.dtype != nn::DType::i32 || tensor.shape.size() != 1)
    throw InputError("tensor '" + name + "' of '" + weights.file + "' is no list of indices. Train the model again");
  std::vector<int32_t> values(static_cast<std::size_t>(tensor.shape[0]));
  if (!values.empty()) std::memcpy(values.data(), tensor.bytes.data(), tensor.bytes.size());
  for (const int32_t value : values)
    if (value < 0)
      throw InputError("tensor '" + name + "' of '" + weights.file + "' holds the index " + std::to_string(value) +
                       " (allowed: 0 and more). Train the model again");
  return values;
}

int64_t extent(const nn::Weights& weights, const std::string& name, std::size_t axis) {
  const nn::Tensor& tensor = find(weights, name);
  if (axis >= tensor.shape.size())
    throw InputError("tensor '" + name + "' of '" + weights.file + "' has too few axes. Train the model again");
  return tensor.shape[axis];
}

}  // namespace graupel::rom
