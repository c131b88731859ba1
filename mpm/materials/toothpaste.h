// Toothpaste: neo-Hookean with a separate volume term, psi = K/2 ((J^2 - 1)/2 - ln J) + mu/2 (tr b_ - D),
// tau = K/2 (J^2 - 1) I + s, s = mu dev b_, b_ = J^(-2/D) F F^T, and Herschel-Bulkley flow of s (Yue et al. 2015; NSF,
// appendix F.5, with the update of the elastic F that NSF leaves out: Simo and Hughes 1998, box 9.1). J is kept: the
// mean of the new b_ is that which makes det b_ = 1.
#pragma once

#include "core/svd.h"
#include "mpm/materials/herschel_bulkley.h"

namespace graupel::mpm {

/// The m > 0 with prod (a_i + m) = 1 for deviatoric a, from a start above it, where the product is convex.
template <typename T>
GRAUPEL_HD inline T unimodular_mean(const Vec<T, 2>& a, T) {
  return std::sqrt(T(1) + a[0] * a[0]);
}
template <typename T>
GRAUPEL_HD inline T unimodular_mean(const Vec<T, 3>& a, T above) {
  const T second = a[0] * a[1] + a[1] * a[2] + a[2] * a[0], third = a[0] * a[1] * a[2];
  constexpr T precise = sizeof(T) == 4 ? T(1e-4) : T(1e-8);  // of the last step; the error is its square
  T mean = above;
  for (int i = 0; i < 40; ++i) {
    const T step = (((mean * mean + second) * mean + third) - T(1)) / (T(3) * mean * mean + second);
    mean -= step;
    if (!(std::abs(step) > precise * mean)) break;
  }
  return mean;
}

/// One step from the decomposition `d` of the trial F -> elastic F, J; returns the Kirchhoff stress [Pa]. An inverted F
/// has no stress; its J <= 0 ends the run.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> toothpaste_update(const MaterialParameters<T>& m, T dt, Svd<T, D> d, Mat<T, D>& F, T& J) {
  J = d.sigma[0];
  for (int i = 1; i < D; ++i) J *= d.sigma[i];
  if (!(J > T(0))) return Mat<T, D>::zero();
  const T isochoric = std::pow(J, T(-2) / T(D));
  Vec<T, D> b;
  for (int i = 0; i < D; ++i) b[i] = isochoric * d.sigma[i] * d.sigma[i];
  const T mean = sum_of(b) / T(D);
  Vec<T, D> deviator = deviator_of(b);
  const T trial = m.mu * norm(deviator);
  if (trial > m.yield_strength) {
    deviator *= herschel_bulkley_stress(m, m.mu * mean, dt, trial) / trial;
    const T new_mean = unimodular_mean(deviator, mean);
    for (int i = 0; i < D; ++i) d.sigma[i] = std::sqrt((deviator[i] + new_mean) / isochoric);
    F = d.U * Mat<T, D>::diagonal(d.sigma) * transpose(d.V);
  }
  const T volumetric = T(0.5) * (m.lambda + T(2) * m.mu / T(D)) * (J * J - T(1));
  return spectral(d.U, m.mu * deviator + Vec<T, D>::filled(volumetric));
}

template <typename T, int D>
GRAUPEL_HD inline T toothpaste_energy(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  const T J = determinant(F), bulk = m.lambda + T(2) * m.mu / T(D);
  return T(0.5) * (bulk * (T(0.5) * (J * J - T(1)) - std::log(J)) +
                   m.mu * (std::pow(J, T(-2) / T(D)) * double_dot(F, F) - T(D)));
}

/// Upper estimate of the wave speed [m/s]: K/2 (J^2 + 1) of the volume term and 2 mu (D - 1)/D of the largest isochoric
/// stretch (exact at rest).
template <typename T, int D>
GRAUPEL_HD inline T toothpaste_sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T J) {
  const T stretch2 = std::pow(J, T(-2) / T(D)) * largest_stretch2_bound(F);
  const T bulk = m.lambda + T(2) * m.mu / T(D);
  return std::sqrt((T(0.5) * bulk * (J * J + T(1)) + T(2) * m.mu * T(D - 1) / T(D) * stretch2) / m.density);
}

}  // namespace graupel::mpm
