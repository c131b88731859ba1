// A column under its own weight, sigma_yy = -rho g (H - y), settled by rho g H^2 / (2 M) at its top (cb-geo's
// benchmark: H 0.1 m, 1800 kg/m^3, g 9.81 m/s^2, 1765.8 Pa at the base; its own code is 4.8, 2.3 and 1.1 % off at
// dx 0.01, 0.005 and 0.0025 m). Damped by pic transfers, compared at every particle.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome self_weight_column(const RunOptions& options);

}  // namespace graupel::validation
