#include "nn/weights.h"

#include <cmath>
#include <cstring>

#include "core/system/error.h"

namespace graupel::nn {

namespace {

std::string text_of(const std::vector<int64_t>& shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

template <typename Stored, typename Convert>
std::vector<float> widen(const Tensor& tensor, Convert convert) {
  const auto n = static_cast<std::size_t>(tensor.count());
  GRAUPEL_ASSERT(tensor.bytes.size() == n * sizeof(Stored));
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) {
    Stored stored;
    std::memcpy(&stored, tensor.bytes.data() + i * sizeof(Stored), sizeof(Stored));
    values[i] = convert(stored);
  }
  return values;
}

template <typename Stored, typename Convert>
std::vector<std::byte> narrow(const std::vector<float>& values, Convert convert) {
  std::vector<std::byte> bytes(values.size() * sizeof(Stored));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Stored stored = convert(values[i]);
    std::memcpy(bytes.data() + i * sizeof(Stored), &stored, sizeof(Stored));
  }
  return bytes;
}

}  // namespace

std::size_t size_of(DType dtype) {
  switch (dtype) {
    case DType::f64:
    case DType::i64:
      return 8;
    case DType::f32:
    case DType::i32:
      return 4;
    case DType::f16:
    case DType::bf16:
      return 2;
    case DType::i8:
    case DType::u8:
      return 1;
  }
  throw std::logic_error("size_of: not a DType");
}

int64_t Tensor::count() const {
  int64_t n = 1;
  for (const int64_t extent : shape) n *= extent;
  return n;
}

std::vector<float> Tensor::as_float() const {
  switch (dtype) {
    case DType::f64:
      return widen<double>(*this, [](double x) { return static_cast<float>(x); });
    case DType::f32:
      return widen<float>(*this, [](float x) { return x; });
    case DType::f16:
      return widen<uint16_t>(*this, float_from_f16);
    case DType::bf16:
      return widen<uint16_t>(*this, float_from_bf16);
    default:
      throw InputError("a tensor of integers stands where floats are needed (F64, F32, F16 or BF16)");
  }
}

Tensor Tensor::from_float(const std::vector<float>& values, std::vector<int64_t> shape, DType dtype) {
  Tensor tensor{.dtype = dtype, .shape = std::move(shape), .bytes = {}};
  GRAUPEL_ASSERT(tensor.count() == static_cast<int64_t>(values.size()));
  if (dtype == DType::f64)
    tensor.bytes = narrow<double>(values, [](float x) { return static_cast<double>(x); });
  else if (dtype == DType::f32)
    tensor.bytes = narrow<float>(values, [](float x) { return x; });
  else if (dtype == DType::f16)
    tensor.bytes = narrow<uint16_t>(values, f16_from_float);
  else if (dtype == DType::bf16)
    tensor.bytes = narrow<uint16_t>(values, bf16_from_float);
  else
    throw std::logic_error("Tensor::from_float: not a float type");
  return tensor;
}

std::vector<float> Weights::get(const std::string& name, const std::vector<int64_t>& shape) const {
  const std::string where = "'" + file + "': tensor '" + name + "' ";
  const auto found = tensors.find(name);
  if (found == tensors.end())
    throw InputError(where + "is missing (the file has " + std::to_string(tensors.size()) +
                     " tensors). Use a weights file of this architecture");
  if (found->second.shape != shape)
    throw InputError(where + "has another shape (" + text_of(found->second.shape) + ", needed " + text_of(shape) +
                     "). Its sizes must agree with the file's own hyper-parameters");
  std::vector<float> values;
  try {
    values = found->second.as_float();
  } catch (const InputError& error) {
    throw InputError(where + "has another type: " + error.what());
  }
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      throw InputError(where + "is damaged (element " + std::to_string(i) + " is " + std::to_string(values[i]) +
                       "). Choose a checkpoint from before the training diverged");
  return values;
}

}  // namespace graupel::nn
