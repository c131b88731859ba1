// Names in trajectory files.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

namespace graupel::io {

inline constexpr const char* trajectory_format = "graupel-trajectory";
inline constexpr int64_t trajectory_format_version = 1;

/// "/00000" without the slash.
inline std::string trajectory_group(int64_t number) {
  char text[24];
  std::snprintf(text, sizeof text, "%05lld", static_cast<long long>(number));
  return text;
}

}  // namespace graupel::io
