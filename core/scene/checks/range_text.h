// Numbers and their ranges, as messages and docs write them.
#pragma once

#include <string>

#include "core/scene/fields.h"

namespace graupel {

/// "> 0", ">= 0 and < 0.5"; "" when every number is allowed.
std::string range_text(const Range& range);
/// Shortest text that reads back to the same number.
std::string number_text(double value);

}  // namespace graupel
