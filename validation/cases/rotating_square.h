// A rotating and flying elastic square (matter's EnergyTest): side 1 m, omega 1/s, v_cm (0.5, 0.5) m/s, E 1 MPa,
// nu 0.3, 1550 kg/m^3, 20 s. The motion is rigid: transfers that lose energy or angular momentum show here.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome rotating_square(const RunOptions& options);

}  // namespace graupel::validation
