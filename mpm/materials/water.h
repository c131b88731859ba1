// Weakly compressible water from the scalar J = det F alone: tau = -p J I + 2 mu_v J dev(sym C), mu_v the dynamic
// viscosity. Pressure p = K (1 - J) (linear: Taichi Elements with K = lambda), or p = K / gamma (J^-gamma - 1)
// (Tait law; Cole 1948, Monaghan 1994). Both resist tension as they do compression.
#pragma once

#include "mpm/material_parameters.h"

namespace graupel::mpm {

/// J of the next step: det(I + dt C) J.
template <typename T, int D>
GRAUPEL_HD inline T water_volume_ratio(const Mat<T, D>& increment, T J) {
  return determinant(increment) * J;
}

/// Kirchhoff pressure term: tau = water_stress I [Pa].
template <typename T>
GRAUPEL_HD inline T water_stress(const MaterialParameters<T>& m, T J) {
  if (m.equation_of_state == EquationOfState::linear) return m.bulk_modulus * J * (J - T(1));
  return m.bulk_modulus / m.tait_exponent * J * (T(1) - std::pow(J, -m.tait_exponent));
}

/// Kirchhoff stress of the viscosity [Pa] at the affine velocity C [1/s]; volume changes cost nothing (Stokes).
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> viscous_stress(const MaterialParameters<T>& m, const Mat<T, D>& C, T J) {
  const T scale = m.viscosity * J, mean = T(2) * trace(C) / T(D);
  Mat<T, D> tau;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) tau(r, c) = scale * (C(r, c) + C(c, r) - (r == c ? mean : T(0)));
  return tau;
}

/// Energy density [J/m^3 of reference volume].
template <typename T>
GRAUPEL_HD inline T water_energy(const MaterialParameters<T>& m, T J) {
  if (m.equation_of_state == EquationOfState::linear) return T(0.5) * m.bulk_modulus * (J - T(1)) * (J - T(1));
  const T g = m.tait_exponent;
  const T stored = g == T(1) ? -std::log(J) : (std::pow(J, T(1) - g) - T(1)) / (g - T(1));
  return m.bulk_modulus / g * (stored + J - T(1));
}

/// Sound speed [m/s] of water stretched or compressed to J: c^2 = K J^2 / rho0, Tait K J^(1 - gamma) / rho0.
template <typename T>
GRAUPEL_HD inline T water_sound_speed(const MaterialParameters<T>& m, T J) {
  if (m.equation_of_state == EquationOfState::linear) return J * m.elastic_speed;
  return m.elastic_speed * std::sqrt(std::pow(J, T(1) - m.tait_exponent));
}

}  // namespace graupel::mpm
