#include "io/pickle_numbers.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "io/unreadable.h"

namespace graupel::io {

namespace {

template <typename Number>
Number element(const PickleValue& array, std::size_t index) {
  char bytes[sizeof(Number)];
  std::memcpy(bytes, array.bytes.data() + index * sizeof(Number), sizeof(Number));
  if (array.element.big_endian) std::reverse(std::begin(bytes), std::end(bytes));
  Number value;
  std::memcpy(&value, bytes, sizeof(Number));
  return value;
}

/// Where the element with this number, counted row by row, lies in Fortran's order.
std::size_t fortran_index(const std::vector<int64_t>& shape, std::size_t index) {
  std::size_t out = 0, stride = 1;
  for (const int64_t size : shape) stride *= static_cast<std::size_t>(size);
  for (std::size_t axis = shape.size(); axis-- > 0;) {
    const auto size = static_cast<std::size_t>(shape[axis]);
    stride /= size;
    out += index % size * stride;
    index /= size;
  }
  return out;
}

template <typename Number, typename Out>
std::vector<Out> converted(const PickleValue& array) {
  std::vector<Out> out(static_cast<std::size_t>(element_count(array)));
  const bool reorder = array.fortran_order && array.shape.size() > 1;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto value = element<Number>(array, reorder ? fortran_index(array.shape, i) : i);
    if constexpr (std::is_same_v<Number, uint64_t>)
      if (value > uint64_t(std::numeric_limits<int64_t>::max())) throw Unreadable("a whole number is above 2^63");
    out[i] = static_cast<Out>(+value);
  }
  return out;
}

[[noreturn]] void refuse(const PickleValue& array, const char* wanted) {
  const ElementType& type = array.element;
  throw Unreadable(std::string("it has elements of type '") + type.kind + std::to_string(type.bytes) + "' where " +
                   wanted + " are needed");
}

}  // namespace

int64_t element_count(const PickleValue& array) {
  int64_t count = 1;
  for (const int64_t size : array.shape) count *= size;  // checked when it was read
  return count;
}

std::string shape_text(const std::vector<int64_t>& shape) {
  std::string out = "(";
  for (const int64_t size : shape) out += (out.size() > 1 ? ", " : "") + std::to_string(size);
  return out + (shape.size() == 1 ? ",)" : ")");
}

std::vector<float> real_numbers(const PickleValue& array) {
  const ElementType& type = array.element;
  if (type.kind == 'f' && type.bytes == 4) return converted<float, float>(array);
  if (type.kind == 'f' && type.bytes == 8) return converted<double, float>(array);
  refuse(array, "real numbers of 32 or 64 bits");
}

std::vector<int64_t> whole_numbers(const PickleValue& array) {
  const ElementType& type = array.element;
  const bool with_sign = type.kind == 'i';
  if (!with_sign && type.kind != 'u') refuse(array, "whole numbers");
  switch (type.bytes) {
    case 1:
      return with_sign ? converted<int8_t, int64_t>(array) : converted<uint8_t, int64_t>(array);
    case 2:
      return with_sign ? converted<int16_t, int64_t>(array) : converted<uint16_t, int64_t>(array);
    case 4:
      return with_sign ? converted<int32_t, int64_t>(array) : converted<uint32_t, int64_t>(array);
    default:
      return with_sign ? converted<int64_t, int64_t>(array) : converted<uint64_t, int64_t>(array);
  }
}

}  // namespace graupel::io
