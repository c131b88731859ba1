// Viscous flows with known profiles: the decay of a shear wave, exp(-nu k^2 t); a Newtonian film on an incline,
// u = (rho g_x / mu)(H y - y^2 / 2); and a Bingham film, whose upper part of thickness tau_0 / (rho g_x) moves as a
// plug at rho g_x (H - h_plug)^2 / (2 mu_B).
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome shear_wave(const RunOptions& options);
Outcome poiseuille_film(const RunOptions& options);
Outcome bingham_film(const RunOptions& options);

}  // namespace graupel::validation
