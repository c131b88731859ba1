#include "compare/pictures/png.h"

#include <png.h>

#include <new>
#include <stdexcept>
#include <string_view>

#include "core/system/error.h"

namespace graupel::compare {

std::string encode_png(const Image& image) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(header);
  std::string bytes(size, '\0');
  if (!png_image_write_to_memory(&header, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr)) {
    if (std::string_view(header.message).find("memory") != std::string_view::npos) throw std::bad_alloc();
    throw std::runtime_error(std::string("PNG encoding failed: ") + header.message);
  }
  bytes.resize(size);
  return bytes;
}

Image decode_png(const std::string& bytes) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  const auto fail = [&]() -> Image {
    const std::string message = header.message;
    png_image_free(&header);
    throw InputError("not a readable PNG (" + message + "). Use an undamaged PNG file");
  };
  if (!png_image_begin_read_from_memory(&header, bytes.data(), bytes.size())) return fail();
  header.format = PNG_FORMAT_RGB;
  Image image(static_cast<int>(header.width), static_cast<int>(header.height));
  if (!png_image_finish_read(&header, nullptr, image.rgb.data(), 0, nullptr)) return fail();
  return image;
}

}  // namespace graupel::compare
