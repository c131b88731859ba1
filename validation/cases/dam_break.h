// The collapse of a column of water of width a = 0.05715 m and height 2a (Martin and Moyce 1952): front Z = x/a over
// T = t sqrt(2 g / a), height H at the wall over t sqrt(g / a). Water without viscosity runs 5-15 % ahead of the
// experiment, whose gate and floor delay it; its front cannot be faster than dZ/dT = 2 (Ritter 1892).
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome dam_break(const RunOptions& options);

}  // namespace graupel::validation
