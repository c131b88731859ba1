// Fixed corotated elasticity (Stomakhin et al. 2012): psi = mu |F - R|^2 + lambda/2 (J - 1)^2,
// tau = P F^T = 2 mu (F - R) F^T + lambda J (J - 1) I, R the rotation of F.
#pragma once

#include "core/math/svd.h"
#include "mpm/materials/material_parameters.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

/// Principal Kirchhoff stress of the singular values s of F: 2 mu (s - 1) s + lambda J (J - 1). `hardening` scales both
/// Lame constants (snow; 1 for jelly).
template <typename S, int D>
GRAUPEL_HD inline Vec<S, D> corotated_principal_stress(const MaterialParameters<Real<S>>& m, S hardening,
                                                       const Vec<S, D>& sigma) {
  using T = Real<S>;
  const S J = product_of(sigma), pressure = m.lambda * J * (J - T(1));
  Vec<S, D> principal;
  for (int i = 0; i < D; ++i) principal[i] = hardening * (T(2) * m.mu * (sigma[i] - T(1)) * sigma[i] + pressure);
  return principal;
}

/// The same stress without hardening from the rotation of F, which costs less than its singular values.
template <typename S, int D>
GRAUPEL_HD inline Mat<S, D> jelly_stress(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S J) {
  using T = Real<S>;
  const S pressure = m.lambda * J * (J - T(1));
  Mat<S, D> strain = rotation_of(F);
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) strain(r, c) = T(2) * m.mu * (F(r, c) - strain(r, c));
  Mat<S, D> tau;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      S t = strain(r, 0) * F(c, 0);
      for (int k = 1; k < D; ++k) t += strain(r, k) * F(c, k);
      tau(r, c) = r == c ? t + pressure : t;
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

/// Estimate of the wave speed [m/s] in deformed jelly: rho0 c^2 <= 2 mu s^2 + lambda J^2 <= rho0 c0^2 max(s^2, J^2), s
/// the largest stretch, taken as s^2 = |F|^2 - (D - 1) (exact where the other stretches are 1).
template <typename S, int D>
GRAUPEL_HD inline S jelly_sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S J) {
  using T = Real<S>;
  const S stretch2 = squared_norm(F) - T(D - 1);
  return m.elastic_speed * square_root(larger(larger(stretch2, J * J), S(T(1))));
}

struct JellyLaw {
  static constexpr MaterialModel model = MaterialModel::jelly;
  static constexpr Measure measure = Measure::deformation;
  static constexpr double initial_internal = 1;        ///< J
  static constexpr bool keeps_volume_positive = true;  ///< J <= 0 ends the run
  static constexpr bool sound_speed_reads_F = true;

  template <typename S, int D>
  GRAUPEL_HD static Mat<S, D> update(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S& J) {
    J = determinant(F);
    return jelly_stress(m, F, J);
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T) {
    return corotated_energy(m, T(1), svd(F).sigma);
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S J) {
    return jelly_sound_speed(m, F, J);
  }
};

}  // namespace graupel::mpm
