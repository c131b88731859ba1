// Weakly compressible water: tau = K J (J - 1) I, energy K/2 (J - 1)^2 a reference volume, from the scalar J alone
// (Taichi Elements with K = lambda). The linear law resists tension as it does compression.
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
  return m.bulk_modulus * J * (J - T(1));
}

/// Energy density [J/m^3 of reference volume].
template <typename T>
GRAUPEL_HD inline T water_energy(const MaterialParameters<T>& m, T J) {
  return T(0.5) * m.bulk_modulus * (J - T(1)) * (J - T(1));
}

/// Sound speed [m/s] of water stretched or compressed to J: c = J sqrt(K / rho0).
template <typename T>
GRAUPEL_HD inline T water_sound_speed(const MaterialParameters<T>& m, T J) {
  return J * std::sqrt(m.bulk_modulus / m.density);
}

}  // namespace graupel::mpm
