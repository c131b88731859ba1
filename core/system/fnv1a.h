// 64-bit FNV-1a (Fowler, Noll, Vo): a checksum for files and for what runs depend on. Every step can be undone, so any
// single changed byte changes it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace graupel {

inline constexpr uint64_t fnv_start = 14695981039346656037ull;

/// Of `n` bytes, continuing from `hash`.
inline uint64_t fnv1a(uint64_t hash, const void* bytes, std::size_t n) {
  const auto* p = static_cast<const unsigned char*>(bytes);
  for (std::size_t i = 0; i < n; ++i) hash = (hash ^ p[i]) * 1099511628211ull;
  return hash;
}

}  // namespace graupel
