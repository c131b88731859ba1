// Constants of one material in the precision and form that kernels use.
#pragma once

#include "core/parallel/host_device.h"
#include "core/scene/material_config.h"

namespace graupel::mpm {

template <typename T>
struct MaterialParameters {
  MaterialModel model;
  VolumeCorrection volume_correction;
  EquationOfState equation_of_state;
  Elasticity elasticity;
  HardeningUpdate hardening_update;
  T density;               ///< rho0 [kg/m^3]
  T bulk_modulus;          ///< K [Pa], water
  T tait_exponent;         ///< gamma, water
  T viscosity;             ///< dynamic [Pa s], water
  T lambda, mu;            ///< Lame constants [Pa]
  T elastic_speed;         ///< sqrt((lambda + 2 mu) / rho0); water: sqrt(K / rho0) [m/s]
  T friction;              ///< alpha = sqrt(2/3) 2 sin(phi) / (3 - sin(phi)), sand
  T cohesion_length;       ///< |dev eps| that cohesion holds without pressure, sand
  T tension_limit;         ///< c cot(phi) [Pa], sand
  T critical_compression;  ///< theta_c, snow
  T critical_stretch;      ///< theta_s, snow
  T hardening;             ///< xi, snow
  T max_hardening;         ///< cap of h, 0 for none
  T yield_strength;        ///< sqrt(2/3) sigma_Y: bound of |dev tau| [Pa]
  T hardening_slope;       ///< its change with equivalent plastic strain [Pa], below 0 for softening
  T flow_consistency;      ///< eta: excess of |dev tau| = eta |plastic rate|^n [Pa s^n]
  T flow_index;            ///< n
};

/// Constants of a material as a scene names it.
template <typename T>
MaterialParameters<T> material_parameters(const MaterialConfig& config) {
  const double E = config.youngs_modulus, nu = config.poissons_ratio;
  const double lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), mu = E / (2 * (1 + nu));
  const double phi = config.friction_angle * 3.14159265358979323846 / 180, sine = std::sin(phi);
  const double stiffness = config.model == MaterialModel::water        ? config.bulk_modulus
                           : config.model == MaterialModel::stationary ? 0
                                                                       : lambda + 2 * mu;
  const double slope = config.model == MaterialModel::metal  ? config.hardening_modulus
                       : config.model == MaterialModel::cake ? -config.softening_modulus
                                                             : 0;
  MaterialParameters<T> m{};
  m.model = config.model;
  m.volume_correction = config.volume_correction;
  m.equation_of_state = config.equation_of_state;
  m.elasticity = config.elasticity;
  m.hardening_update = config.hardening_update;
  m.density = static_cast<T>(config.density);
  m.bulk_modulus = static_cast<T>(config.bulk_modulus);
  m.tait_exponent = static_cast<T>(config.tait_exponent);
  m.viscosity = static_cast<T>(config.model == MaterialModel::water ? config.viscosity : 0);
  m.lambda = static_cast<T>(lambda);
  m.mu = static_cast<T>(mu);
  m.elastic_speed = static_cast<T>(std::sqrt(stiffness / config.density));
  m.friction = static_cast<T>(std::sqrt(2.0 / 3) * 2 * sine / (3 - sine));
  m.cohesion_length = static_cast<T>(std::sqrt(6.0) * 2 * std::cos(phi) / (3 - sine) * config.cohesion / (2 * mu));
  m.tension_limit = static_cast<T>(config.cohesion > 0 ? std::fmin(config.cohesion / std::tan(phi), 1e30) : 0);
  m.critical_compression = static_cast<T>(config.critical_compression);
  m.critical_stretch = static_cast<T>(config.critical_stretch);
  m.hardening = static_cast<T>(config.hardening);
  m.max_hardening = static_cast<T>(config.max_hardening);
  m.yield_strength = static_cast<T>(std::sqrt(2.0 / 3) * config.yield_stress);
  m.hardening_slope = static_cast<T>(std::sqrt(2.0 / 3) * slope);
  m.flow_consistency = static_cast<T>(config.consistency * std::pow(2.0, (1 + config.flow_index) / 2));
  m.flow_index = static_cast<T>(config.flow_index);
  return m;
}

}  // namespace graupel::mpm
