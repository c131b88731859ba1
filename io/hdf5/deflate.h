// The deflate filter of HDF5 (zlib streams). libdeflate expands them where Graupel was built with it, else zlib; zlib
// compresses, since its bytes are those of the HDF5 library.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace graupel::io {

/// Empty where the result would be longer than what the library's filter allows for it. `level` is 1 to 9.
std::vector<std::byte> deflated(std::span<const std::byte> values, int level);

/// Whether `packed` is a stream of exactly out.size() bytes, which are then in `out`.
bool inflate_into(std::span<const std::byte> packed, std::span<std::byte> out);

}  // namespace graupel::io
