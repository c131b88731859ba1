// Sand (Klar et al. 2016): StVK-Hencky elasticity psi = mu |ln S|^2 + lambda/2 (tr ln S)^2, Drucker-Prager yield
// |dev eps| + (D lambda + 2 mu)/(2 mu) tr(eps) alpha <= 0, no cohesion, and a volume correction v_c that lets sand
// which was stretched apart close up again without pressure.
#pragma once

#include "core/svd.h"
#include "mpm/material_parameters.h"

namespace graupel::mpm {

/// tau = U diag(2 mu ln s + lambda tr ln s) U^T [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> hencky_stress(const MaterialParameters<T>& m, const Mat<T, D>& U, const Vec<T, D>& strain) {
  T sum = 0;
  for (int i = 0; i < D; ++i) sum += strain[i];
  Vec<T, D> principal;
  for (int i = 0; i < D; ++i) principal[i] = T(2) * m.mu * strain[i] + m.lambda * sum;
  return spectral(U, principal);
}

template <typename T, int D>
GRAUPEL_HD inline T hencky_energy(const MaterialParameters<T>& m, const Vec<T, D>& strain) {
  T sum = 0, squares = 0;
  for (int i = 0; i < D; ++i) {
    sum += strain[i];
    squares += strain[i] * strain[i];
  }
  return m.mu * squares + T(0.5) * m.lambda * sum * sum;
}

/// Logarithmic strains of the singular values; |s| below 1e-4 counts as 1e-4 (Taichi Elements), so that a collapsed or
/// inverted trial F is brought back by the projection.
template <typename T, int D>
GRAUPEL_HD inline Vec<T, D> logarithmic_strain(const Vec<T, D>& sigma) {
  Vec<T, D> strain;
  for (int i = 0; i < D; ++i) {
    const T s = std::abs(sigma[i]);
    strain[i] = std::log(s > T(1e-4) ? s : T(1e-4));
  }
  return strain;
}

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
  if (sum >= T(0)) {  // no tension: the grains come apart
    strain = Vec<T, D>::zero();
    v_c = m.volume_correction == VolumeCorrection::none ? T(0) : sum;
    return true;
  }
  v_c = T(0);
  Vec<T, D> deviator;
  for (int i = 0; i < D; ++i) deviator[i] = strain[i] - sum / T(D);
  const T length = norm(deviator);
  const T excess = length + (T(D) * m.lambda + T(2) * m.mu) / (T(2) * m.mu) * sum * m.friction;
  if (excess <= T(0)) return changed;
  for (int i = 0; i < D; ++i) strain[i] -= excess / length * deviator[i];
  return true;
}

/// One step of sand from the decomposition `d` of the trial F -> elastic F, v_c; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> sand_update(const MaterialParameters<T>& m, Svd<T, D> d, Mat<T, D>& F, T& v_c) {
  Vec<T, D> strain = logarithmic_strain(d.sigma);
  const bool inverted = !(d.sigma[D - 1] > T(1e-4));
  if (sand_return_mapping(m, strain, v_c) || inverted) {
    for (int i = 0; i < D; ++i) d.sigma[i] = std::exp(strain[i]);
    F = d.U * Mat<T, D>::diagonal(d.sigma) * transpose(d.V);
  }
  return hencky_stress(m, d.U, strain);
}

}  // namespace graupel::mpm
