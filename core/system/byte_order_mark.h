// Byte order marks, which some editors put before the text of a file.
#pragma once

#include <string_view>

namespace graupel {

/// Bytes of UTF-8's mark at the start of `text`: 3, or 0 where there is none. It says nothing to a reader of UTF-8.
inline std::size_t utf8_mark(std::string_view text) { return text.starts_with("\xef\xbb\xbf") ? 3 : 0; }

/// The encoding that is no UTF-8 by the mark at the start of `text`; "" for none.
inline std::string_view wide_encoding(std::string_view text) {
  using namespace std::string_view_literals;
  if (text.starts_with("\xff\xfe\0\0"sv) || text.starts_with("\0\0\xfe\xff"sv)) return "UTF-32";
  return text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff") ? "UTF-16" : "";
}

}  // namespace graupel
