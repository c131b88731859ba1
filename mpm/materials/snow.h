// Snow (Stomakhin et al. 2013): fixed corotated elasticity, singular values of F held in [1 - theta_c, 1 + theta_s],
// Lame constants times h = exp(xi (1 - J_p)), J_p the volume ratio that plastic flow took.
// The stress uses the h of the new J_p, or, as in Taichi Elements, of the J_p before the step's return mapping
// (hardening_update). Where one axis is stretched while the others are squeezed the clamp can give energy back: the
// model has no yield surface in stress.
#pragma once

#include "mpm/materials/jelly.h"

namespace graupel::mpm {

/// h(J_p), capped at m.max_hardening unless that is 0.
template <typename S>
GRAUPEL_HD inline S snow_hardening(const MaterialParameters<Real<S>>& m, S J_p) {
  using T = Real<S>;
  const S h = exponential(m.hardening * (T(1) - J_p));
  return m.max_hardening > T(0) ? smaller(h, S(m.max_hardening)) : h;
}

/// Clamps the singular values and moves what was cut off into J_p; returns whether anything changed.
template <typename S, int D>
GRAUPEL_HD inline MaskOf<S> snow_return_mapping(const MaterialParameters<Real<S>>& m, Vec<S, D>& sigma, S& J_p) {
  using T = Real<S>;
  const S low = S(T(1) - m.critical_compression), high = S(T(1) + m.critical_stretch);
  S growth = S(T(1));
  MaskOf<S> clamped = MaskOf<S>(false);
  for (int i = 0; i < D; ++i) {
    const S inside = smaller(larger(sigma[i], low), high), ratio = inside / sigma[i];
    growth *= ratio;
    clamped = clamped | (ratio != T(1));
    sigma[i] = inside;
  }
  J_p = select(clamped, J_p / growth, J_p);
  return clamped;
}

struct SnowLaw {
  static constexpr MaterialModel model = MaterialModel::snow;
  static constexpr Measure measure = Measure::stretches;
  static constexpr double initial_internal = 1;  ///< J_p
  static constexpr bool keeps_volume_positive = false;
  static constexpr bool sound_speed_reads_F = false;

  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update(const MaterialParameters<Real<S>>& m, Real<S>, Vec<S, D>& sigma, S& J_p,
                                     Vec<S, D>& principal) {
    const S old = J_p;
    const MaskOf<S> clamped = snow_return_mapping(m, sigma, J_p);
    const S h = snow_hardening(m, m.hardening_update == HardeningUpdate::before ? old : J_p);
    principal = corotated_principal_stress(m, h, sigma);
    return clamped;
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T J_p) {
    return corotated_energy(m, snow_hardening(m, J_p), svd(F).sigma);
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>&, S J_p) {
    return m.elastic_speed * square_root(snow_hardening(m, J_p));
  }
};

}  // namespace graupel::mpm
