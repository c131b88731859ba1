// An RGB picture in memory.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace graupel::compare {

using Color = std::array<uint8_t, 3>;  ///< sRGB

struct Image {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  ///< [height, width, 3], top row first

  Image() = default;
  Image(int w, int h, Color fill = {0, 0, 0}) : width(w), height(h), rgb(static_cast<std::size_t>(w) * h * 3) {
    for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = fill[i % 3];
  }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
  Color at(int x, int y) const {
    const std::size_t i = (static_cast<std::size_t>(y) * width + x) * 3;
    return {rgb[i], rgb[i + 1], rgb[i + 2]};
  }
  void set(int x, int y, Color color) {
    const std::size_t i = (static_cast<std::size_t>(y) * width + x) * 3;
    for (std::size_t c = 0; c < 3; ++c) rgb[i + c] = color[c];
  }
};

/// Copies `source` into `target` with its top left corner at (x, y); parts outside are dropped.
void paste(Image& target, const Image& source, int x, int y);

}  // namespace graupel::compare
