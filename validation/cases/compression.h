// Uniaxial compression of a cube between a smooth floor and a smooth plate (cb-geo's benchmark: E 1000 Pa, nu 0.2,
// sigma = E u / l = -1 Pa after a strain of 0.001, lateral strain -nu times the axial one), and compression in a rigid
// box, -p / ln J = K (matter, 3 %). Damped by pic transfers.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome uniaxial_compression(const RunOptions& options);
Outcome bulk_compression(const RunOptions& options);

}  // namespace graupel::validation
