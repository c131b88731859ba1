#include "core/system/human_time.h"

#include <cmath>
#include <cstdio>

namespace graupel {

std::string human_time(double seconds) {
  char text[64];
  if (seconds >= 3600)
    std::snprintf(text, sizeof text, "%.0f h %02.0f min", std::floor(seconds / 3600),
                  std::floor(std::fmod(seconds, 3600) / 60));
  else if (seconds >= 60)
    std::snprintf(text, sizeof text, "%.0f min %02.0f s", std::floor(seconds / 60), std::floor(std::fmod(seconds, 60)));
  else if (seconds >= 0.1)
    std::snprintf(text, sizeof text, "%.1f s", seconds);
  else
    std::snprintf(text, sizeof text, "%.1f ms", seconds * 1e3);
  return text;
}

}  // namespace graupel
