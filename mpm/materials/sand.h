// Sand (Klar et al. 2016): StVK-Hencky elasticity and Drucker-Prager yield
// |dev eps| + (D lambda + 2 mu)/(2 mu) tr(eps) alpha <= |dev eps|_c, whose right-hand side is cohesion (0 for dry
// sand), with isochoric flow and a volume correction v_c that lets sand which was stretched apart close up again
// without pressure (Tampubolon et al. 2017): v_c grows by what the projection takes from the volumetric strain.
// Cohesion c of the Mohr-Coulomb law, matched in triaxial compression as alpha is:
// |dev tau| <= 2 sqrt(6) / (3 - sin phi) (p sin phi + c cos phi). Grains that the tension p = -c cot phi pulled apart
// have no cohesion until they close again: keeping it would give energy back as they do.
#pragma once

#include "mpm/materials/hencky.h"

namespace graupel::mpm {

/// Drucker-Prager return mapping of logarithmic strains (Klar et al. 2016, eq. 27-29); returns whether they changed.
/// klar spreads v_c over the strains before the projection; taichi counts it in the trace alone, so that its
/// "deviator" has a trace while v_c != 0; none forgets tension at once.
template <typename S, int D>
GRAUPEL_HD inline MaskOf<S> sand_return_mapping(const MaterialParameters<Real<S>>& m, Vec<S, D>& strain, S& v_c) {
  using T = Real<S>;
  const S zero = S(T(0));
  S sum = sum_of(strain);
  MaskOf<S> changed = MaskOf<S>(false);
  if (m.volume_correction == VolumeCorrection::klar) {
    changed = v_c != T(0);
    for (int i = 0; i < D; ++i) strain[i] += v_c / T(D);
    sum = sum_of(strain);
  } else if (m.volume_correction == VolumeCorrection::taichi) {
    sum += v_c;
  }
  const T bulk = m.lambda + T(2) * m.mu / T(D);
  // Beyond the cone's tip the grains come apart.
  const MaskOf<S> apart = bulk * sum >= select(v_c > T(0), zero, S(m.tension_limit));
  v_c = m.volume_correction != VolumeCorrection::none ? select(apart, sum, zero) : zero;
  const Vec<S, D> deviator = deviator_of(strain, sum / T(D));
  const S length = length_of(deviator);
  const S excess = length + T(D) * bulk / (T(2) * m.mu) * m.friction * sum - m.cohesion_length;
  const MaskOf<S> yields = excess > T(0);
  const S flow_fraction = select(yields, excess / length, zero);
  for (int i = 0; i < D; ++i) strain[i] = select(apart, zero, strain[i] - flow_fraction * deviator[i]);
  return changed | apart | yields;
}

struct SandLaw {
  static constexpr MaterialModel model = MaterialModel::sand;
  static constexpr Measure measure = Measure::logarithms;
  static constexpr double initial_internal = 0;  ///< v_c
  static constexpr bool keeps_volume_positive = false;
  static constexpr bool sound_speed_reads_F = false;

  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update(const MaterialParameters<Real<S>>& m, Real<S>, Vec<S, D>& strain, S& v_c,
                                     Vec<S, D>& principal) {
    const MaskOf<S> changed = sand_return_mapping(m, strain, v_c);
    principal = hencky_principal_stress(m, strain);
    return changed;
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T) {
    return hencky_energy(m, logarithmic_strain(svd(F).sigma));
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>&, S) {
    return S(m.elastic_speed);
  }
};

}  // namespace graupel::mpm
