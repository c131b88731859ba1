// Text of files for a terminal: control characters in it could move the cursor, hide text or change the title.
#pragma once

#include <string>

namespace graupel {

/// `text` with '?' for each control character but line feeds: C0, DEL, and C1 in UTF-8 (U+0080 to U+009F).
inline std::string printable(std::string text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if ((c < 0x20 && c != '\n') || c == 0x7f) text[i] = '?';
    if (c == 0xc2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xa0) text.replace(i, 2, "?");
  }
  return text;
}

}  // namespace graupel
