// Numbers as text, with the fewest digits that read back to the same bits.
#pragma once

#include <charconv>
#include <string>

namespace graupel::io {

template <typename T>
void append_number(std::string& out, T value) {
  char digits[32];
  out.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

}  // namespace graupel::io
