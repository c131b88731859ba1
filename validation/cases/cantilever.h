// A cantilever under its own weight: tip deflection rho g A L^4 / (8 E I) = 1.5 rho g L^4 / (E h^2), first frequency
// 0.5596 sqrt(E I / (rho A L^4)). L 10 m, h 2 m, E 100 MPa, 1000 kg/m^3: 0.368 m (slosh's case). Released from the
// straight state it swings about its deflection.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome cantilever(const RunOptions& options);

}  // namespace graupel::validation
