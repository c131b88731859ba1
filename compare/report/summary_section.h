// The first screen of the report: a verdict a model, and a table of all by error over the strongest cheap rival.
#pragma once

#include <string>

#include "compare/comparison.h"

namespace graupel::compare {

/// Empty without rollouts.
std::string summary_section(const Comparison& comparison);

}  // namespace graupel::compare
