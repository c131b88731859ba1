// Constants of one material in the precision and form that kernels use.
#pragma once

#include "core/mat.h"
#include "core/material_config.h"

namespace graupel::mpm {

template <typename T>
struct MaterialParameters {
  MaterialModel model;
  VolumeCorrection volume_correction;
  T density;               ///< rho0 [kg/m^3]
  T bulk_modulus;          ///< K [Pa], water
  T lambda, mu;            ///< Lame constants [Pa]
  T elastic_speed;         ///< sqrt((lambda + 2 mu) / rho0); water: sqrt(K / rho0) [m/s]
  T friction;              ///< alpha = sqrt(2/3) 2 sin(phi) / (3 - sin(phi)), sand
  T critical_compression;  ///< theta_c, snow
  T critical_stretch;      ///< theta_s, snow
  T hardening;             ///< xi, snow
  T max_hardening;         ///< cap of h, 0 for none
};

/// Constants of a material as a scene names it.
template <typename T>
MaterialParameters<T> material_parameters(const MaterialConfig& config) {
  const double E = config.youngs_modulus, nu = config.poissons_ratio;
  const double lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), mu = E / (2 * (1 + nu));
  const double sine = std::sin(config.friction_angle * 3.14159265358979323846 / 180);
  const bool water = config.model == MaterialModel::water;
  MaterialParameters<T> m{};
  m.model = config.model;
  m.volume_correction = config.volume_correction;
  m.density = static_cast<T>(config.density);
  m.bulk_modulus = static_cast<T>(config.bulk_modulus);
  m.lambda = static_cast<T>(lambda);
  m.mu = static_cast<T>(mu);
  m.elastic_speed = static_cast<T>(std::sqrt((water ? config.bulk_modulus : lambda + 2 * mu) / config.density));
  m.friction = static_cast<T>(std::sqrt(2.0 / 3) * 2 * sine / (3 - sine));
  m.critical_compression = static_cast<T>(config.critical_compression);
  m.critical_stretch = static_cast<T>(config.critical_stretch);
  m.hardening = static_cast<T>(config.hardening);
  m.max_hardening = static_cast<T>(config.max_hardening);
  return m;
}

/// U diag(values) U^T.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> spectral(const Mat<T, D>& U, const Vec<T, D>& values) {
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      T s = 0;
      for (int k = 0; k < D; ++k) s += U(r, k) * values[k] * U(c, k);
      m(r, c) = s;
      m(c, r) = s;
    }
  return m;
}

}  // namespace graupel::mpm
