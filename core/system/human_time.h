// Durations in words.
#pragma once

#include <string>

namespace graupel {

/// "1 h 02 min", "3 min 20 s", "4.2 s" or "4.2 ms".
std::string human_time(double seconds);

}  // namespace graupel
