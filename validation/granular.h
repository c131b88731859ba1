// Dry sand against the angle of the Drucker-Prager cone in simple shear, tan = 2 sqrt(3) sin(phi) / (3 - sin(phi))
// (24.0, 34.7, 39.3, 43.4 degrees for phi = 20, 30, 35, 40): an endless layer on an incline rests below and flows above
// it; a poured heap has about that slope. Columns of aspect ratio a = H_0 / L_0 collapse to a runout that grows like a
// where they are low and like a^(2/3) where they are tall (Lube et al. 2005, Lajeunesse et al. 2005: 1.2 a, 1.9
// a^(2/3)).
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome infinite_slope(const RunOptions& options);
Outcome angle_of_repose(const RunOptions& options);
Outcome column_collapse(const RunOptions& options);

}  // namespace graupel::validation
