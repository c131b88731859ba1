// Yield of metal and snow in runs of the solver: a bar pulled beyond sigma_Y, with the slope E K / (E + K) of linear
// hardening; a layer sheared beyond sigma_Y / sqrt(3); snow pressed and stretched beyond its elastic range.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome von_mises_bar(const RunOptions& options);
Outcome von_mises_shear(const RunOptions& options);
Outcome snow_range(const RunOptions& options);

}  // namespace graupel::validation
