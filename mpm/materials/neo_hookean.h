// Stable neo-Hookean elasticity (Smith, de Goes and Kim 2018, "Stable Neo-Hookean Flesh Simulation", eq. 13):
//   psi = mu'/2 (I_C - D) - mu'/2 ln(I_C + 1) + lambda'/2 (J - a)^2,   I_C = |F|^2,   a = 1 + D/(D + 1) mu'/lambda',
//   tau = mu' (1 - 1/(I_C + 1)) F F^T + lambda' J (J - a) I.
// The primed constants are remapped so that small strains see the Lame constants mu and lambda (section 3.4 there; for
// D = 3 mu' = 4/3 mu, lambda' = lambda + 5/6 mu). No decomposition of F is needed.
#pragma once

#include "mpm/material_parameters.h"

namespace graupel::mpm {

template <typename T>
struct NeoHookeanConstants {
  T mu, lambda;    ///< mu', lambda' [Pa]
  T rest_product;  ///< lambda' a [Pa]
};

template <int D, typename T>
GRAUPEL_HD inline NeoHookeanConstants<T> neo_hookean_constants(const MaterialParameters<T>& m) {
  const T mu = m.mu * T(D + 1) / T(D);
  const T lambda = m.lambda + m.mu - T(2) * mu / (T(D + 1) * T(D + 1));
  return {mu, lambda, lambda + m.mu};
}

template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> neo_hookean_stress(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  const NeoHookeanConstants<T> k = neo_hookean_constants<D>(m);
  const T J = determinant(F), shear = k.mu * (T(1) - T(1) / (double_dot(F, F) + T(1)));
  Mat<T, D> tau;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      T b = 0;
      for (int i = 0; i < D; ++i) b += F(r, i) * F(c, i);
      tau(r, c) = shear * b + (r == c ? J * (k.lambda * J - k.rest_product) : T(0));
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
template <typename T, int D>
GRAUPEL_HD inline T neo_hookean_sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  const NeoHookeanConstants<T> k = neo_hookean_constants<D>(m);
  const T s2 = largest_stretch2_bound(F), J = determinant(F), share = s2 / (double_dot(F, F) + T(1));
  return std::sqrt((k.mu * (s2 - share) + T(2) * k.mu * share * share + k.lambda * J * J) / m.density);
}

}  // namespace graupel::mpm
