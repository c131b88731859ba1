// The runs of validation/cases/ and validation/exact_laws.cpp, which say what each is held against.
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

Outcome cantilever(const RunOptions& options);
Outcome colliding_disks(const RunOptions& options);
Outcome uniaxial_compression(const RunOptions& options);
Outcome bulk_compression(const RunOptions& options);
Outcome curved_track(const RunOptions& options);
Outcome dam_break(const RunOptions& options);
Outcome elastic_bar(const RunOptions& options);
Outcome infinite_slope(const RunOptions& options);
Outcome angle_of_repose(const RunOptions& options);
Outcome column_collapse(const RunOptions& options);
Outcome hole_in_plate(const RunOptions& options);
Outcome rotating_square(const RunOptions& options);
Outcome self_weight_column(const RunOptions& options);
Outcome sliding_block(const RunOptions& options);
Outcome moving_plane(const RunOptions& options);
Outcome turntable(const RunOptions& options);
Outcome shear_wave(const RunOptions& options);
Outcome poiseuille_film(const RunOptions& options);
Outcome bingham_film(const RunOptions& options);
Outcome von_mises_bar(const RunOptions& options);
Outcome von_mises_shear(const RunOptions& options);
Outcome snow_range(const RunOptions& options);

}  // namespace graupel::validation
