// What of the affine velocity is kept after a step: all (APIC), its rotation (RPIC) or nothing (PIC), damped.
#pragma once

#include "core/scene/transfer_config.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// C <- exp(-damping dt) times the scheme's part of C, of all particles.
template <typename T>
void apply_transfer_scheme(const SolverView<T>& view, const TransferConfig& transfer, double dt);

extern template void apply_transfer_scheme(const SolverView<float>&, const TransferConfig&, double);
extern template void apply_transfer_scheme(const SolverView<double>&, const TransferConfig&, double);

}  // namespace graupel::mpm
