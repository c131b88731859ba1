// The report's tables in full: means over the scenes and over categories, and every metric of each scene.
#pragma once

#include <string>

#include "compare/comparison.h"

namespace graupel::compare {

std::string tables_section(const Comparison& comparison);

}  // namespace graupel::compare
