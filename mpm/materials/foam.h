// Foam: StVK-Hencky elasticity with Herschel-Bulkley flow of dev tau = 2 mu dev(ln S) (the "foam" of warp-mpm, there
// with n = 1 and mu tr(F F^T)/3 for the flow's modulus, which would change the steady stress; here it is mu, so that
// the law holds exactly). The internal variable is the equivalent plastic strain; it does not act back.
#pragma once

#include "mpm/materials/hencky.h"
#include "mpm/materials/herschel_bulkley.h"

namespace graupel::mpm {

/// One step from the decomposition `d` of the trial F -> elastic F, e; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> foam_update(const MaterialParameters<T>& m, T dt, const Svd<T, D>& d, Mat<T, D>& F, T& e) {
  Vec<T, D> strain = logarithmic_strain(d.sigma);
  const Vec<T, D> deviator = deviator_of(strain);
  const T length = norm(deviator), trial = T(2) * m.mu * length;
  if (trial > m.yield_strength) {
    const T flow = length * (T(1) - herschel_bulkley_stress(m, m.mu, dt, trial) / trial);
    strain -= (flow / length) * deviator;
    e += T(0.81649658092772603) * flow;  // sqrt(2/3)
    F = deformation_of_strain(d, strain);
  } else if (is_collapsed(d.sigma)) {
    F = deformation_of_strain(d, strain);
  }
  return hencky_stress(m, d.U, strain);
}

}  // namespace graupel::mpm
