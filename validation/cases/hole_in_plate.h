// A wide plate with a hole of radius R = 0.2 W, half its width W, in tension: the stress at the hole's edge is 3.14
// times that far from it (Heywood 1952: (2 + (1 - 2R/2W)^3) / (1 - 2R/2W); cb-geo's benchmark gets 3.13).
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome hole_in_plate(const RunOptions& options);

}  // namespace graupel::validation
