// Weakly compressible water from the scalar J = det F alone: tau = -p J I + 2 mu_v J dev(sym C), mu_v the dynamic
// viscosity. Pressure p = K (1 - J) (linear: Taichi Elements with K = lambda), or p = K / gamma (J^-gamma - 1)
// (Tait law; Cole 1948, Monaghan 1994). Both resist tension as they do compression.
#pragma once

#include "mpm/materials/material_parameters.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

/// Kirchhoff pressure term: tau = water_stress I [Pa].
template <typename S>
GRAUPEL_HD inline S water_stress(const MaterialParameters<Real<S>>& m, S J) {
  using T = Real<S>;
  if (m.equation_of_state == EquationOfState::linear) return m.bulk_modulus * J * (J - T(1));
  return m.bulk_modulus / m.tait_exponent * J * (T(1) - power(J, -m.tait_exponent));
}

/// Kirchhoff stress of the viscosity [Pa] at the affine velocity C [1/s]; volume changes cost nothing (Stokes).
template <typename S, int D>
GRAUPEL_HD inline Mat<S, D> viscous_stress(const MaterialParameters<Real<S>>& m, const Mat<S, D>& C, S J) {
  using T = Real<S>;
  S divergence = C(0, 0);
  for (int i = 1; i < D; ++i) divergence += C(i, i);
  const S scale = m.viscosity * J, mean = T(2) / T(D) * divergence;
  Mat<S, D> tau;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      const S rate = C(r, c) + C(c, r);
      tau(r, c) = scale * (r == c ? rate - mean : rate);
      tau(c, r) = tau(r, c);
    }
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
template <typename S>
GRAUPEL_HD inline S water_sound_speed(const MaterialParameters<Real<S>>& m, S J) {
  using T = Real<S>;
  if (m.equation_of_state == EquationOfState::linear) return J * m.elastic_speed;
  return m.elastic_speed * power(J, T(0.5) * (T(1) - m.tait_exponent));
}

struct WaterLaw {
  static constexpr MaterialModel model = MaterialModel::water;
  static constexpr Measure measure = Measure::volume_ratio;
  static constexpr double initial_internal = 1;        ///< J
  static constexpr bool keeps_volume_positive = true;  ///< J <= 0 ends the run
  static constexpr bool sound_speed_reads_F = false;

  template <typename S, int D>
  GRAUPEL_HD static S volume_ratio(const Mat<S, D>& increment, S J) {
    return determinant(increment) * J;
  }
  template <typename S>
  GRAUPEL_HD static S mean_stress(const MaterialParameters<Real<S>>& m, S J) {
    return water_stress(m, J);
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>&, T J) {
    return water_energy(m, J);
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>&, S J) {
    return water_sound_speed(m, J);
  }
};

}  // namespace graupel::mpm
