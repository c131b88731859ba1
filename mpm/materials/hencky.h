// StVK-Hencky elasticity: psi = mu |ln S|^2 + lambda/2 (tr ln S)^2, tau = U diag(2 mu ln s + lambda tr ln S) U^T, of
// the singular values s of F = U S V^T (Klar et al. 2016). Its return maps move the logarithmic strains ln s.
#pragma once

#include "core/svd.h"
#include "mpm/material_parameters.h"

namespace graupel::mpm {

/// tau [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> hencky_stress(const MaterialParameters<T>& m, const Mat<T, D>& U, const Vec<T, D>& strain) {
  const T sum = sum_of(strain);
  Vec<T, D> principal;
  for (int i = 0; i < D; ++i) principal[i] = T(2) * m.mu * strain[i] + m.lambda * sum;
  return spectral(U, principal);
}

template <typename T, int D>
GRAUPEL_HD inline T hencky_energy(const MaterialParameters<T>& m, const Vec<T, D>& strain) {
  const T sum = sum_of(strain);
  return m.mu * dot(strain, strain) + T(0.5) * m.lambda * sum * sum;
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

/// Whether logarithmic_strain() had to repair the singular values.
template <typename T, int D>
GRAUPEL_HD inline bool is_collapsed(const Vec<T, D>& sigma) {
  return !(sigma[D - 1] > T(1e-4));
}

/// F = U diag(exp(strain)) V^T.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> deformation_of_strain(Svd<T, D> d, const Vec<T, D>& strain) {
  for (int i = 0; i < D; ++i) d.sigma[i] = std::exp(strain[i]);
  return d.U * Mat<T, D>::diagonal(d.sigma) * transpose(d.V);
}

/// Wave speed [m/s]: rho0 c^2 = lambda + 2 mu - tau_ii along a principal axis, bounded by the pressure and by the
/// `deviator` that the stress can have [Pa].
template <typename T, int D>
GRAUPEL_HD inline T hencky_sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T deviator) {
  const T J = determinant(F), pressure = -(m.lambda + T(2) * m.mu / T(D)) * std::log(J > T(1e-12) ? J : T(1e-12));
  const T stiffness = m.lambda + T(2) * m.mu + (pressure > T(0) ? pressure : T(0)) + deviator;
  return std::sqrt(stiffness / m.density);
}

}  // namespace graupel::mpm
