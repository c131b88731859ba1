// Snow (Stomakhin et al. 2013): fixed corotated elasticity, singular values of F held in [1 - theta_c, 1 + theta_s],
// Lame constants times h = exp(xi (1 - J_p)), J_p the volume ratio that plastic flow took.
// The stress uses the h of the new J_p, or, as in Taichi Elements, of the J_p before the step's return mapping
// (hardening_update). Where one axis is stretched while the others are squeezed the clamp can give energy back: the
// model has no yield surface in stress.
#pragma once

#include "mpm/materials/jelly.h"

namespace graupel::mpm {

/// h(J_p), capped at m.max_hardening unless that is 0.
template <typename T>
GRAUPEL_HD inline T snow_hardening(const MaterialParameters<T>& m, T J_p) {
  const T h = std::exp(m.hardening * (T(1) - J_p));
  return m.max_hardening > T(0) && h > m.max_hardening ? m.max_hardening : h;
}

/// Clamps the singular values and moves what was cut off into J_p; returns whether anything changed.
template <typename T, int D>
GRAUPEL_HD inline bool snow_return_mapping(const MaterialParameters<T>& m, Vec<T, D>& sigma, T& J_p) {
  const T low = T(1) - m.critical_compression, high = T(1) + m.critical_stretch;
  bool changed = false;
  for (int i = 0; i < D; ++i) {
    const T clamped = sigma[i] < low ? low : sigma[i] > high ? high : sigma[i];
    if (clamped == sigma[i]) continue;
    J_p *= sigma[i] / clamped;
    sigma[i] = clamped;
    changed = true;
  }
  return changed;
}

/// One step of snow from the decomposition `d` of the trial F -> elastic F, J_p; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> snow_update(const MaterialParameters<T>& m, Svd<T, D> d, Mat<T, D>& F, T& J_p) {
  T h = snow_hardening(m, J_p);
  if (snow_return_mapping(m, d.sigma, J_p)) {
    F = d.U * Mat<T, D>::diagonal(d.sigma) * transpose(d.V);
    if (m.hardening_update == HardeningUpdate::after) h = snow_hardening(m, J_p);
  }
  return corotated_stress(m, h, d.U, d.sigma);
}

template <typename T>
GRAUPEL_HD inline T snow_sound_speed(const MaterialParameters<T>& m, T J_p) {
  return m.elastic_speed * std::sqrt(snow_hardening(m, J_p));
}

}  // namespace graupel::mpm
