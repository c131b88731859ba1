// Two elastic disks that collide (Sulsky, Chen and Schreyer 1994; karamelo, two-disks): E 1000 Pa, nu 0.3, 1000 kg/m^3,
// radius 0.2 m, centres (0.2, 0.2) and (0.8, 0.8) m, velocities +-(0.1, 0.1) m/s, dx 0.05 m. Surfaces meet at
// (0.6 sqrt(2) - 0.4) / (0.2 sqrt(2)) = 1.586 s; the grid lets them feel each other about dx / (relative speed) before.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome colliding_disks(const RunOptions& options);

}  // namespace graupel::validation
