#include "mpm/phases/transfer_scheme.h"

#include "mpm/physics/transfer.h"

namespace graupel::mpm {

template <typename T>
void apply_transfer_scheme(const SolverView<T>& view, const TransferConfig& transfer, double dt) {
  const CarriedAffine<T> carried = carried_affine<T>(transfer, dt);
  if (!carried.all) blend_affine(view, carried.symmetric, carried.rotation);
}

template void apply_transfer_scheme(const SolverView<float>&, const TransferConfig&, double);
template void apply_transfer_scheme(const SolverView<double>&, const TransferConfig&, double);

}  // namespace graupel::mpm
