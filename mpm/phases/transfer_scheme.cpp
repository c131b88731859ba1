#include "mpm/phases/transfer_scheme.h"

#include <cmath>

namespace graupel::mpm {

template <typename T>
void apply_transfer_scheme(const SolverView<T>& view, const TransferConfig& transfer, double dt) {
  if (transfer.scheme == TransferScheme::apic && transfer.damping == 0) return;
  const double kept = std::exp(-transfer.damping * dt);
  const double symmetric = transfer.scheme == TransferScheme::apic ? kept : 0;
  const double rotation = transfer.scheme == TransferScheme::pic ? 0 : kept;
  blend_affine(view, static_cast<T>(symmetric), static_cast<T>(rotation));
}

template void apply_transfer_scheme(const SolverView<float>&, const TransferConfig&, double);
template void apply_transfer_scheme(const SolverView<double>&, const TransferConfig&, double);

}  // namespace graupel::mpm
