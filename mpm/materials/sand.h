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
template <typename T, int D>
GRAUPEL_HD inline bool sand_return_mapping(const MaterialParameters<T>& m, Vec<T, D>& strain, T& v_c) {
  bool changed = false;
  if (m.volume_correction == VolumeCorrection::klar && v_c != T(0)) {
    for (int i = 0; i < D; ++i) strain[i] += v_c / T(D);
    changed = true;
  }
  T sum = m.volume_correction == VolumeCorrection::taichi ? v_c : T(0);
  for (int i = 0; i < D; ++i) sum += strain[i];
  const T bulk = m.lambda + T(2) * m.mu / T(D);
  if (bulk * sum >= (v_c > T(0) ? T(0) : m.tension_limit)) {  // beyond the cone's tip: the grains come apart
    strain = Vec<T, D>::zero();
    v_c = m.volume_correction == VolumeCorrection::none ? T(0) : sum;
    return true;
  }
  v_c = T(0);
  Vec<T, D> deviator;
  for (int i = 0; i < D; ++i) deviator[i] = strain[i] - sum / T(D);
  const T length = norm(deviator);
  const T excess = length + T(D) * bulk / (T(2) * m.mu) * sum * m.friction - m.cohesion_length;
  if (excess <= T(0)) return changed;
  for (int i = 0; i < D; ++i) strain[i] -= excess / length * deviator[i];
  return true;
}

/// One step of sand from the decomposition `d` of the trial F -> elastic F, v_c; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> sand_update(const MaterialParameters<T>& m, const Svd<T, D>& d, Mat<T, D>& F, T& v_c) {
  Vec<T, D> strain = logarithmic_strain(d.sigma);
  if (sand_return_mapping(m, strain, v_c) || is_collapsed(d.sigma)) F = deformation_of_strain(d, strain);
  return hencky_stress(m, d.U, strain);
}

}  // namespace graupel::mpm
