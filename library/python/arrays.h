// Arrays that Python gives.
#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include "library/python/binding.h"

namespace graupel::python {

/// In C order, on the host.
template <typename T>
using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

/// Anything that NumPy makes an array of, no copy where it is that already. Throws ConfigError, which names it, for
/// anything but real numbers and, where T is whole, for fractions.
template <typename T>
Array<T> array_from(const char* name, nb::handle values) {
  const char* kind = std::is_same_v<T, float> ? "float32" : std::is_same_v<T, double> ? "float64" : "int64";
  return nb::cast<Array<T>>(nb::module_::import_("graupel._plain").attr("real_array")(name, values, kind));
}

/// Throws ConfigError for an array that is not [n, tail..], with what is `allowed`.
template <typename T>
void check_shape(const char* name, const Array<T>& array, const std::vector<std::size_t>& tail, const char* allowed) {
  bool fits = array.ndim() == tail.size() + 1;
  for (std::size_t d = 0; fits && d < tail.size(); ++d) fits = array.shape(d + 1) == tail[d];
  if (fits) return;
  std::string shape;
  for (std::size_t d = 0; d < array.ndim(); ++d) shape += (d == 0 ? "" : ", ") + std::to_string(array.shape(d));
  throw ConfigError(std::string(name) + " has the wrong shape ([" + shape + "], allowed: " + allowed + "). Reshape it");
}

}  // namespace graupel::python
