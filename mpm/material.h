// One step of any material: deformation, return mapping, stress; chosen by the material's model.
//
// A particle keeps the elastic deformation gradient F (identity for water and stationary particles) and one internal
// variable:
//   J = det F          water, jelly, neo_hookean, toothpaste
//   J_p                snow: volume ratio of the plastic flow
//   v_c                sand: logarithmic volume gained in tension
//   plastic strain     metal, cake, foam: equivalent, sqrt(2/3) sum |dev flow|
//   none (0)           stationary
#pragma once

#include "mpm/materials/foam.h"
#include "mpm/materials/jelly.h"
#include "mpm/materials/neo_hookean.h"
#include "mpm/materials/sand.h"
#include "mpm/materials/snow.h"
#include "mpm/materials/toothpaste.h"
#include "mpm/materials/von_mises.h"
#include "mpm/materials/water.h"

namespace graupel::mpm {

/// Whether the internal variable is a volume ratio that must stay positive; plastic models repair F instead.
GRAUPEL_HD inline bool internal_variable_is_volume_ratio(MaterialModel model) {
  return model == MaterialModel::water || model == MaterialModel::jelly || model == MaterialModel::neo_hookean ||
         model == MaterialModel::toothpaste;
}

/// Value of the internal variable in the undeformed state.
GRAUPEL_HD inline double initial_internal_variable(MaterialModel model) {
  return internal_variable_is_volume_ratio(model) || model == MaterialModel::snow ? 1.0 : 0.0;
}

/// Whether F is part of the particle's state.
GRAUPEL_HD inline bool keeps_deformation(MaterialModel model) {
  return model != MaterialModel::water && model != MaterialModel::stationary;
}

/// Whether the model works on the singular values of F.
GRAUPEL_HD inline bool needs_svd(MaterialModel model) {
  return keeps_deformation(model) && model != MaterialModel::neo_hookean;
}

/// Trial state of a step with the affine velocity C [1/s]: F <- (I + dt C) F, water J <- det(I + dt C) J.
template <typename T, int D>
GRAUPEL_HD inline void trial_deformation(const MaterialParameters<T>& m, T dt, const Mat<T, D>& C, Mat<T, D>& F,
                                         T& internal) {
  const Mat<T, D> increment = Mat<T, D>::identity() + dt * C;
  if (m.model == MaterialModel::water)
    internal = water_volume_ratio(increment, internal);
  else if (m.model != MaterialModel::stationary)
    F = increment * F;
}

/// map_and_stress() of the models beyond water, jelly, snow and sand; by value, so that a caller's own copies of the
/// other models' state can stay in registers.
template <typename T, int D>
GRAUPEL_COLD GRAUPEL_HD Mat<T, D> map_and_stress_of_others(const MaterialParameters<T>& m, T dt, Svd<T, D> d,
                                                           Mat<T, D>& F, T& internal) {
  switch (m.model) {
    case MaterialModel::neo_hookean:
      internal = determinant(F);
      return neo_hookean_stress(m, F);
    case MaterialModel::metal:
    case MaterialModel::cake:
      return von_mises_update(m, d, F, internal);
    case MaterialModel::toothpaste:
      return toothpaste_update(m, dt, d, F, internal);
    case MaterialModel::foam:
      return foam_update(m, dt, d, F, internal);
    default:
      return Mat<T, D>::zero();
  }
}

/// Return mapping and Kirchhoff stress [Pa] of a trial state, viscosity of water excepted. `d` is the decomposition of
/// F (unused where needs_svd() is false), `dt` the step that led to it [s].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_and_stress(const MaterialParameters<T>& m, T dt, const Svd<T, D>& d, Mat<T, D>& F,
                                           T& internal) {
  if (m.model == MaterialModel::water) return Mat<T, D>::diagonal(Vec<T, D>::filled(water_stress(m, internal)));
  if (m.model == MaterialModel::snow) return snow_update(m, d, F, internal);
  if (m.model == MaterialModel::sand) return sand_update(m, d, F, internal);
  if (m.model != MaterialModel::jelly) {
    Mat<T, D> F_of_others = F;
    T internal_of_others = internal;
    const Mat<T, D> tau = map_and_stress_of_others(m, dt, d, F_of_others, internal_of_others);
    F = F_of_others;
    internal = internal_of_others;
    return tau;
  }
  internal = determinant(F);
  return corotated_stress(m, T(1), d.U, d.sigma);
}

/// map_and_stress() of one solid particle, which decomposes F as its model needs it.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_and_stress_of_solid(const MaterialParameters<T>& m, T dt, Mat<T, D>& F, T& internal) {
  if constexpr (D == 3)
    if (m.model == MaterialModel::jelly) {
      internal = determinant(F);
      return jelly_stress(m, F, internal);
    }
  return map_and_stress(m, dt, needs_svd(m.model) ? svd(F) : Svd<T, D>{}, F, internal);
}

/// Kirchhoff stress [Pa] of water and stationary particles.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> fluid_stress(const MaterialParameters<T>& m, const Mat<T, D>& C, T internal) {
  if (m.model != MaterialModel::water) return Mat<T, D>::zero();
  Mat<T, D> tau = Mat<T, D>::diagonal(Vec<T, D>::filled(water_stress(m, internal)));
  if (m.viscosity > T(0)) tau += viscous_stress(m, C, internal);
  return tau;
}

/// One step of a particle's deformation; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> update_material(const MaterialParameters<T>& m, T dt, const Mat<T, D>& C, Mat<T, D>& F,
                                            T& internal) {
  trial_deformation(m, dt, C, F, internal);
  if (!keeps_deformation(m.model)) return fluid_stress(m, C, internal);
  return map_and_stress_of_solid(m, dt, F, internal);
}

/// Elastic energy density [J/m^3 of reference volume].
template <typename T, int D>
GRAUPEL_HD inline T energy_density(const MaterialParameters<T>& m, const Mat<T, D>& F, T internal) {
  switch (m.model) {
    case MaterialModel::water:
      return water_energy(m, internal);
    case MaterialModel::jelly:
      return jelly_energy(m, F);
    case MaterialModel::snow:
      return corotated_energy(m, snow_hardening(m, internal), svd(F).sigma);
    case MaterialModel::sand:
    case MaterialModel::foam:
      return hencky_energy(m, logarithmic_strain(svd(F).sigma));
    case MaterialModel::neo_hookean:
      return neo_hookean_energy(m, F);
    case MaterialModel::metal:
    case MaterialModel::cake:
      return von_mises_energy(m, F, internal);
    case MaterialModel::toothpaste:
      return toothpaste_energy(m, F);
    case MaterialModel::stationary:
      break;
  }
  return T(0);
}

/// Whether sound_speed() reads F.
GRAUPEL_HD inline bool sound_speed_needs_deformation(MaterialModel model) {
  return keeps_deformation(model) && model != MaterialModel::snow && model != MaterialModel::sand;
}

/// sound_speed() of the models beyond water, jelly, snow and sand.
template <typename T, int D>
GRAUPEL_COLD GRAUPEL_HD T sound_speed_of_others(const MaterialParameters<T>& m, Mat<T, D> F, T internal) {
  switch (m.model) {
    case MaterialModel::neo_hookean:
      return neo_hookean_sound_speed(m, F);
    case MaterialModel::metal:
    case MaterialModel::cake:
      return von_mises_sound_speed(m, F, internal);
    case MaterialModel::toothpaste:
      return toothpaste_sound_speed(m, F, internal);
    case MaterialModel::foam:
      return hencky_sound_speed(m, F, m.yield_strength);
    default:
      return m.elastic_speed;
  }
}

/// Sound speed [m/s] of the present state; never below that of the state at rest.
template <typename T, int D>
GRAUPEL_HD inline T sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T internal) {
  T c = m.elastic_speed;
  if (m.model == MaterialModel::water)
    c = water_sound_speed(m, internal);
  else if (m.model == MaterialModel::jelly)
    c = jelly_sound_speed(m, F, internal);
  else if (m.model == MaterialModel::snow)
    c = snow_sound_speed(m, internal);
  else if (m.model != MaterialModel::sand)
    c = sound_speed_of_others(m, F, internal);
  return c > m.elastic_speed ? c : m.elastic_speed;
}

}  // namespace graupel::mpm
