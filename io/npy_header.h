// Header of NumPy's .npy format, versions 1 to 3: magic, version, length, then a Python dictionary with the element
// type, the order and the shape (numpy/lib/format.py).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace graupel::io {

struct NpyHeader {
  std::string element;  ///< "|O" for objects, "<f4", ...
  bool fortran_order = false;
  std::vector<int64_t> shape;
  std::size_t bytes = 0;  ///< of the header; the data follow
};

/// Throws Unreadable.
NpyHeader read_npy_header(std::string_view file);

/// Header of a list of `count` Python objects, padded as NumPy does.
std::string npy_object_header(int64_t count);

}  // namespace graupel::io
