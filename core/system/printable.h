// Text of files for a terminal: control characters in it could move the cursor, hide text or change the title.
#pragma once

#include <string>
#include <string_view>

namespace graupel {

/// Bytes of the UTF-8 sequence at the start of `text`, 0 where there is none (RFC 3629).
inline std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const unsigned lead = byte(0), next = byte(1);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if (byte(i) >> 6 != 2) return 0;
  const bool overlong = (lead == 0xe0 && next < 0xa0) || (lead == 0xf0 && next < 0x90);
  const bool no_character = (lead == 0xed && next >= 0xa0) || (lead == 0xf4 && next >= 0x90);
  return overlong || no_character ? 0 : length;
}

/// `text` with '?' for each control character but line feeds (C0, DEL and C1, U+0080 to U+009F) and for each byte that
/// is no UTF-8: terminals take 0x80 to 0x9f for C1 too.
inline std::string printable(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const auto c = static_cast<unsigned char>(text[0]);
    const bool controls =
        length == 1 ? (c < 0x20 && c != '\n') || c == 0x7f : c == 0xc2 && static_cast<unsigned char>(text[1]) < 0xa0;
    if (length == 0 || controls)
      out += '?';
    else
      out += text.substr(0, length);
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return out;
}

/// `text`, of a longer one the first `limit` bytes, without a part of a character, and "...".
inline std::string shortened(std::string_view text, std::size_t limit = 60) {
  if (text.size() <= limit) return std::string(text);
  while (limit > 0 && (static_cast<unsigned char>(text[limit]) & 0xc0) == 0x80) --limit;
  return std::string(text.substr(0, limit)) + "...";
}

/// An error's text; of one that quotes a large part of a file the begin, which names the file, and the end, which has
/// the remedy.
inline std::string shortened_message(std::string_view text) {
  constexpr std::size_t begin = 2500, end = 1000;
  if (text.size() <= begin + end) return std::string(text);
  return shortened(text, begin) + " " + std::string(text.substr(text.size() - end));
}

/// The same for a terminal.
inline std::string message_text(std::string_view text) { return printable(shortened_message(text)); }

}  // namespace graupel
