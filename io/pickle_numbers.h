// The numbers of a pickled array, row by row, whatever their width, byte order and order in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "io/pickle.h"

namespace graupel::io {

/// Number of elements.
int64_t element_count(const PickleValue& array);
/// "(600, 1500, 3)".
std::string shape_text(const std::vector<int64_t>& shape);

/// Of an array of real numbers; f64 is rounded. Throws Unreadable for other elements.
std::vector<float> real_numbers(const PickleValue& array);
/// Of an array of whole numbers. Throws Unreadable for other elements, and above 2^63.
std::vector<int64_t> whole_numbers(const PickleValue& array);

}  // namespace graupel::io
