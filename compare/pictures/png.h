// PNG files to and from memory (libpng).
#pragma once

#include <string>

#include "compare/pictures/image.h"

namespace graupel::compare {

/// The bytes of a PNG file.
std::string encode_png(const Image& image);
/// Throws InputError when `bytes` is no PNG or is damaged.
Image decode_png(const std::string& bytes);

}  // namespace graupel::compare
