// Fixed corotated elasticity (Stomakhin et al. 2012): psi = mu |F - R|^2 + lambda/2 (J - 1)^2,
// tau = P F^T = 2 mu (F - R) F^T + lambda J (J - 1) I, R the rotation of F.
#pragma once

#include "core/polar.h"
#include "core/svd.h"
#include "mpm/material_parameters.h"

namespace graupel::mpm {

/// Kirchhoff stress from the singular values s of F and its left rotation U: U diag(2 mu (s - 1) s + lambda J (J-1))
/// U^T. `hardening` scales both Lame constants (snow; 1 for jelly).
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> corotated_stress(const MaterialParameters<T>& m, T hardening, const Mat<T, D>& U,
                                             const Vec<T, D>& sigma) {
  T J = 1;
  for (int i = 0; i < D; ++i) J *= sigma[i];
  Vec<T, D> principal;
  for (int i = 0; i < D; ++i)
    principal[i] = hardening * (T(2) * m.mu * (sigma[i] - T(1)) * sigma[i] + m.lambda * J * (J - T(1)));
  return spectral(U, principal);
}

/// The same without hardening from the rotation of F, which costs less than its singular values.
template <typename T>
GRAUPEL_HD inline Mat<T, 3> jelly_stress(const MaterialParameters<T>& m, const Mat<T, 3>& F, T J) {
  const Mat<T, 3> R = polar_rotation(F), strain = F - R;
  const T pressure = m.lambda * J * (J - T(1));
  Mat<T, 3> tau;
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) {
      T s = 0;
      for (int k = 0; k < 3; ++k) s += strain(r, k) * F(c, k);
      tau(r, c) = T(2) * m.mu * s + (r == c ? pressure : T(0));
      tau(c, r) = tau(r, c);
    }
  return tau;
}

template <typename T, int D>
GRAUPEL_HD inline T corotated_energy(const MaterialParameters<T>& m, T hardening, const Vec<T, D>& sigma) {
  T J = 1, shear = 0;
  for (int i = 0; i < D; ++i) {
    J *= sigma[i];
    shear += (sigma[i] - T(1)) * (sigma[i] - T(1));
  }
  return hardening * (m.mu * shear + T(0.5) * m.lambda * (J - T(1)) * (J - T(1)));
}

template <typename T, int D>
GRAUPEL_HD inline T jelly_energy(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  return corotated_energy(m, T(1), svd(F).sigma);
}

/// Estimate of the wave speed [m/s] in deformed jelly: rho0 c^2 <= 2 mu s^2 + lambda J^2 <= rho0 c0^2 max(s^2, J^2), s
/// the largest stretch, taken as s^2 = |F|^2 - (D - 1) (exact where the other stretches are 1).
template <typename T, int D>
GRAUPEL_HD inline T jelly_sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T J) {
  const T stretch2 = double_dot(F, F) - T(D - 1), growth2 = stretch2 > J * J ? stretch2 : J * J;
  return m.elastic_speed * std::sqrt(growth2 > T(1) ? growth2 : T(1));
}

}  // namespace graupel::mpm
