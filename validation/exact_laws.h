// Laws that hold to rounding, whatever the resolution: free fall, conservation in the transfers, affine fields, the
// kernel's moments, objective stress.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

/// Symplectic Euler: v_n = v_0 - n g dt, x_n = x_0 + n v_0 dt - g dt^2 n (n + 1) / 2; nothing deforms.
Outcome free_fall(const RunOptions& options);
/// Momentum and angular momentum over one substep of any state (Jiang et al. 2015).
Outcome conservation(const RunOptions& options);
/// v = A x + b passes the transfers unchanged, and F becomes I + dt A.
Outcome affine_field(const RunOptions& options);
/// sum w = 1, sum w (x_i - x) = 0, sum w (x_i - x)(x_i - x)^T = dx^2/4 I.
Outcome kernel_moments(const RunOptions& options);
/// tau(R F) = R tau(F) R^T, tau = dpsi/dF F^T, and return maps that change nothing the second time.
Outcome material_laws(const RunOptions& options);

}  // namespace graupel::validation
