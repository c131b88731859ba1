// Herschel-Bulkley flow beyond a yield strength s_Y = sqrt(2/3) sigma_Y of |dev tau| (Yue et al. 2015, "Continuum
// Foam", section 4): plastic rate = ((|s| - s_Y) / eta)^(1/n), whose backward Euler step from the trial stress is
//   |s_trial| - |s| = 2 mu dt ((|s| - s_Y) / eta)^(1/n).
// In steady shear |s| = s_Y + eta |dev d|^n, so the shear stress is sigma_Y / sqrt(3) + k rate^n with
// eta = k 2^((1 + n)/2): for n = 1, NSF's eta = 2 k.
#pragma once

#include "mpm/materials/material_parameters.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

/// The root z in [0, 1] of z + exp(log_k) z^p = 1 for p >= 1: Newton's method from above, which the convexity makes
/// monotone; from the smaller of the bounds 1 and k^(-1/p) it takes a few steps.
template <typename S>
GRAUPEL_HD inline S root_of_power_sum(S log_k, Real<S> p) {
  using T = Real<S>;
  constexpr T precise = sizeof(T) == 4 ? T(1e-4) : T(1e-8);  // of the last step; the error is its square
  const S zero = S(T(0));
  S z = exponential(select(log_k > T(0), log_k / -p, zero));
  for (int i = 0; i < 30 && any(z > T(0)); ++i) {
    const S power = exponential(log_k + p * logarithm(z)), step = (z + power - T(1)) / (T(1) + p * power / z);
    z -= step;
    if (!any(step > precise * z)) break;
  }
  return z;
}

/// |s| [Pa] after a step of dt [s] with the trial stress |s_trial| > s_Y and the shear modulus `mu` of the flow;
/// without meaning in lanes that do not yield.
template <typename S>
GRAUPEL_HD inline S herschel_bulkley_stress(const MaterialParameters<Real<S>>& m, S mu, Real<S> dt, S trial) {
  using T = Real<S>;
  const T eta = m.flow_consistency, n = m.flow_index;
  if (!(eta > T(0))) return S(m.yield_strength);
  const S excess = select(trial > m.yield_strength, trial - m.yield_strength, S(T(1))), relax = T(2) * mu * dt;
  if (n == T(1)) return m.yield_strength + excess / (T(1) + relax / eta);
  if (n < T(1))  // the share z of the excess that stays: z + k z^(1/n) = 1
    return m.yield_strength +
           excess * root_of_power_sum(logarithm(relax / excess) + logarithm(excess / eta) / n, T(1) / n);
  // the share w that flows off: w + k w^n = 1
  const S w = root_of_power_sum(logarithm(eta / excess) + n * logarithm(excess / relax), n);
  return m.yield_strength + excess * (T(1) - w);
}

}  // namespace graupel::mpm
