// Stable neo-Hookean elasticity (Smith, de Goes and Kim 2018, "Stable Neo-Hookean Flesh Simulation", eq. 13):
//   psi = mu'/2 (I_C - D) - mu'/2 ln(I_C + 1) + lambda'/2 (J - a)^2,   I_C = |F|^2,   a = 1 + D/(D + 1) mu'/lambda',
//   tau = mu' (1 - 1/(I_C + 1)) F F^T + lambda' J (J - a) I.
// The primed constants are remapped so that small strains see the Lame constants mu and lambda (section 3.4 there; for
// D = 3 mu' = 4/3 mu, lambda' = lambda + 5/6 mu). No decomposition of F is needed.
#pragma once

#include "mpm/materials/material_parameters.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

template <typename T>
struct NeoHookeanConstants {
  T mu, lambda;    ///< mu', lambda' [Pa]
  T rest_product;  ///< lambda' a [Pa]
};

/// `S`: the scalar of the caller, so that callers for different instruction sets share no code.
template <int D, typename S = void, typename T>
GRAUPEL_HD inline NeoHookeanConstants<T> neo_hookean_constants(const MaterialParameters<T>& m) {
  const T mu = m.mu * T(D + 1) / T(D);
  const T lambda = m.lambda + m.mu - T(2) * mu / (T(D + 1) * T(D + 1));
  return {mu, lambda, lambda + m.mu};
}

template <typename S, int D>
GRAUPEL_HD inline Mat<S, D> neo_hookean_stress(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F) {
  using T = Real<S>;
  const NeoHookeanConstants<T> k = neo_hookean_constants<D, S>(m);
  const S J = determinant(F), shear = k.mu * (T(1) - T(1) / (squared_norm(F) + T(1)));
  const S pressure = J * (k.lambda * J - k.rest_product);
  Mat<S, D> tau;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      S b = F(r, 0) * F(c, 0);
      for (int i = 1; i < D; ++i) b += F(r, i) * F(c, i);
      tau(r, c) = r == c ? shear * b + pressure : shear * b;
      tau(c, r) = tau(r, c);
    }
  return tau;
}

template <typename T, int D>
GRAUPEL_HD inline T neo_hookean_energy(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  const NeoHookeanConstants<T> k = neo_hookean_constants<D>(m);
  const T I = double_dot(F, F), J = determinant(F), a = k.rest_product / k.lambda;
  const T volume = T(0.5) * k.lambda * ((J - a) * (J - a) - (T(1) - a) * (T(1) - a));
  return T(0.5) * k.mu * (I - T(D) - std::log((I + T(1)) / T(D + 1))) + volume;
}

/// Upper bound of the wave speed [m/s] from the acoustic tensor, s the largest stretch:
/// rho0 c^2 <= mu' (1 - 1/(I_C + 1)) s^2 + 2 mu' s^4 / (I_C + 1)^2 + lambda' J^2 (exact at rest).
template <typename S, int D>
GRAUPEL_HD inline S neo_hookean_sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F) {
  using T = Real<S>;
  const NeoHookeanConstants<T> k = neo_hookean_constants<D, S>(m);
  const S s2 = largest_stretch2_bound(F), J = determinant(F), stretch_ratio = s2 / (squared_norm(F) + T(1));
  return square_root((k.mu * (s2 - stretch_ratio) + T(2) * k.mu * stretch_ratio * stretch_ratio + k.lambda * J * J) /
                     m.density);
}

struct NeoHookeanLaw {
  static constexpr MaterialModel model = MaterialModel::neo_hookean;
  static constexpr Measure measure = Measure::deformation;
  static constexpr double initial_internal = 1;        ///< J
  static constexpr bool keeps_volume_positive = true;  ///< J <= 0 ends the run
  static constexpr bool sound_speed_reads_F = true;

  template <typename S, int D>
  GRAUPEL_HD static Mat<S, D> update(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S& J) {
    J = determinant(F);
    return neo_hookean_stress(m, F);
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T) {
    return neo_hookean_energy(m, F);
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S) {
    return neo_hookean_sound_speed(m, F);
  }
};

}  // namespace graupel::mpm
