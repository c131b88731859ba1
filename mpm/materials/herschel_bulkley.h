// Herschel-Bulkley flow beyond a yield strength s_Y = sqrt(2/3) sigma_Y of |dev tau| (Yue et al. 2015, "Continuum
// Foam", section 4): plastic rate = ((|s| - s_Y) / eta)^(1/n), whose backward Euler step from the trial stress is
//   |s_trial| - |s| = 2 mu dt ((|s| - s_Y) / eta)^(1/n).
// In steady shear |s| = s_Y + eta |dev d|^n, so the shear stress is sigma_Y / sqrt(3) + k rate^n with
// eta = k 2^((1 + n)/2): for n = 1, NSF's eta = 2 k.
#pragma once

#include "mpm/material_parameters.h"

namespace graupel::mpm {

/// The root z in [0, 1] of z + exp(log_k) z^p = 1 for p >= 1: Newton's method from above, which the convexity makes
/// monotone; from the smaller of the bounds 1 and k^(-1/p) it takes a few steps.
template <typename T>
GRAUPEL_HD inline T root_of_power_sum(T log_k, T p) {
  constexpr T precise = sizeof(T) == 4 ? T(1e-4) : T(1e-8);  // of the last step; the error is its square
  T z = std::exp(log_k > T(0) ? -log_k / p : T(0));
  for (int i = 0; i < 30 && z > T(0); ++i) {
    const T power = std::exp(log_k + p * std::log(z)), step = (z + power - T(1)) / (T(1) + p * power / z);
    z -= step;
    if (!(step > precise * z)) break;
  }
  return z;
}

/// |s| [Pa] after a step of dt [s] with the trial stress |s_trial| > s_Y and the shear modulus `mu` of the flow.
template <typename T>
GRAUPEL_HD inline T herschel_bulkley_stress(const MaterialParameters<T>& m, T mu, T dt, T trial) {
  const T excess = trial - m.yield_strength, eta = m.flow_consistency, n = m.flow_index, relax = T(2) * mu * dt;
  if (!(eta > T(0))) return m.yield_strength;
  if (n == T(1)) return m.yield_strength + excess / (T(1) + relax / eta);
  if (n < T(1))  // the share z of the excess that stays: z + k z^(1/n) = 1
    return m.yield_strength +
           excess * root_of_power_sum(std::log(relax / excess) + std::log(excess / eta) / n, T(1) / n);
  // the share w that flows off: w + k w^n = 1
  const T w = root_of_power_sum(std::log(eta / excess) + n * std::log(excess / relax), n);
  return m.yield_strength + excess * (T(1) - w);
}

}  // namespace graupel::mpm
