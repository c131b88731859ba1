// 64-bit FNV-1a (Fowler, Noll, Vo): a checksum for files and for what runs depend on. Every step can be undone, so any
// single changed byte changes it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace graupel {

inline constexpr uint64_t fnv_start = 14695981039346656037ull;

/// Of `n` bytes, continuing from `hash`.
inline uint64_t fnv1a(uint64_t hash, const void* bytes, std::size_t n) {
  const auto* p = static_cast<const unsigned char*>(bytes);
  for (std::size_t i = 0; i < n; ++i) hash = (hash ^ p[i]) * 1099511628211ull;
  return hash;
}

/// Of a text: 16 hexadecimal digits.
inline std::string fnv1a_digits(std::string_view text) {
  char digits[17];
  std::snprintf(digits, sizeof(digits), "%016llx",
                static_cast<unsigned long long>(fnv1a(fnv_start, text.data(), text.size())));
  return digits;
}

}  // namespace graupel
