// Labels in pictures: a fixed font of 5 x 7 pixels (the foot of g is in an eighth row) for printable ASCII.
#pragma once

#include <string>

#include "compare/pictures/image.h"

namespace graupel::compare {

/// Draws `text` with its top left corner at (x, y), each font pixel `scale` pixels wide. Unknown characters are '?'.
void draw_text(Image& image, int x, int y, const std::string& text, Color color, int scale = 1);
/// Width of the text [pixels]; its height is 7 * scale.
int text_width(const std::string& text, int scale = 1);

}  // namespace graupel::compare
