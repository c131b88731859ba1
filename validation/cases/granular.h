// Dry sand against the angle of the Drucker-Prager cone in simple shear, tan = 2 sqrt(3) sin(phi) / (3 - sin(phi))
// (24.0, 34.7, 39.3, 43.4 degrees for phi = 20, 30, 35, 40): an endless layer on an incline rests below and flows above
// it; a poured heap has about that slope. Columns of aspect ratio a = H_0 / L_0 collapse to a runout (L - L_0) / L_0
// of 1.2 a where they are low and 1.9 a^(2/3) where they are tall (Lube et al. 2005), in wide channels like a^(0.9 +-
// 0.1) (Balmforth and Kerswell 2005).
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome infinite_slope(const RunOptions& options);
Outcome angle_of_repose(const RunOptions& options);
Outcome column_collapse(const RunOptions& options);

}  // namespace graupel::validation
