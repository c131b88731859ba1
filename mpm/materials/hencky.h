// StVK-Hencky elasticity: psi = mu |ln S|^2 + lambda/2 (tr ln S)^2, tau = U diag(2 mu ln s + lambda tr ln S) U^T, of
// the singular values s of F = U S V^T (Klar et al. 2016). Its return maps move the logarithmic strains ln s.
#pragma once

#include "core/math/svd.h"
#include "mpm/materials/material_parameters.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

/// Principal tau [Pa].
template <typename S, int D>
GRAUPEL_HD inline Vec<S, D> hencky_principal_stress(const MaterialParameters<Real<S>>& m, const Vec<S, D>& strain) {
  const S sum = sum_of(strain);
  Vec<S, D> principal;
  for (int i = 0; i < D; ++i) principal[i] = Real<S>(2) * m.mu * strain[i] + m.lambda * sum;
  return principal;
}

template <typename T, int D>
GRAUPEL_HD inline T hencky_energy(const MaterialParameters<T>& m, const Vec<T, D>& strain) {
  const T sum = sum_of(strain);
  return m.mu * dot(strain, strain) + T(0.5) * m.lambda * sum * sum;
}

/// Logarithmic strains of the singular values; |s| below 1e-4 counts as 1e-4 (Taichi Elements), so that a collapsed or
/// inverted trial F is brought back by the projection.
template <typename S, int D>
GRAUPEL_HD inline Vec<S, D> logarithmic_strain(const Vec<S, D>& sigma) {
  using T = Real<S>;
  Vec<S, D> strain;
  for (int i = 0; i < D; ++i) strain[i] = logarithm(larger(magnitude(sigma[i]), S(T(1e-4))));
  return strain;
}

/// Whether logarithmic_strain() had to repair the singular values of a decomposition.
template <typename T, int D>
GRAUPEL_HD inline bool is_collapsed(const Vec<T, D>& sigma) {
  return !(sigma[D - 1] > T(1e-4));
}

/// Wave speed [m/s]: rho0 c^2 = lambda + 2 mu - tau_ii along a principal axis, bounded by the pressure and by the
/// `deviator` that the stress can have [Pa].
template <typename S, int D>
GRAUPEL_HD inline S hencky_sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S deviator) {
  using T = Real<S>;
  const S log_J = logarithm(larger(determinant(F), S(T(1e-12))));
  const S pressure = -(m.lambda + T(2) * m.mu / T(D)) * log_J;
  return square_root((m.lambda + T(2) * m.mu + larger(pressure, S(T(0))) + deviator) / m.density);
}

/// |dev F flow| of one step -> equivalent plastic strain: sqrt(2/3).
template <typename T>
inline constexpr T equivalent_strain = T(0.81649658092772603);

}  // namespace graupel::mpm
