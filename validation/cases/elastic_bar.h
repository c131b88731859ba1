// Free vibration of an elastic bar in its first mode: v = v_0 sin(pi x / 2 L), omega = (pi / 2 L) sqrt(E / rho) for
// nu = 0, E 100 Pa, 1 kg/m^3, L 25 m, v_0 0.1 m/s. Once fixed at a wall, and once free at both ends with twice the
// length, whose middle rests by symmetry: the method's own order of convergence, without that of the wall.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome elastic_bar(const RunOptions& options);

}  // namespace graupel::validation
