// One step of any material: deformation, return mapping, stress; chosen by the material's model.
//
// A particle keeps the elastic deformation gradient F (not water) and one internal variable:
//   water J, jelly J = det F, snow J_p, sand v_c.
#pragma once

#include "mpm/materials/jelly.h"
#include "mpm/materials/sand.h"
#include "mpm/materials/snow.h"
#include "mpm/materials/water.h"

namespace graupel::mpm {

/// Value of the internal variable in the undeformed state.
GRAUPEL_HD inline double initial_internal_variable(MaterialModel model) {
  return model == MaterialModel::sand ? 0.0 : 1.0;
}

/// Whether the internal variable is a volume ratio that must stay positive; plastic models repair F instead.
GRAUPEL_HD inline bool internal_variable_is_volume_ratio(MaterialModel model) {
  return model == MaterialModel::water || model == MaterialModel::jelly;
}

/// Whether the model works on the singular values of F.
GRAUPEL_HD inline bool needs_svd(MaterialModel model) { return model != MaterialModel::water; }

/// Trial state of a step with the affine velocity C [1/s]: F <- (I + dt C) F, water J <- det(I + dt C) J.
template <typename T, int D>
GRAUPEL_HD inline void trial_deformation(const MaterialParameters<T>& m, T dt, const Mat<T, D>& C, Mat<T, D>& F,
                                         T& internal) {
  const Mat<T, D> increment = Mat<T, D>::identity() + dt * C;
  if (m.model == MaterialModel::water)
    internal = water_volume_ratio(increment, internal);
  else
    F = increment * F;
}

/// Return mapping and Kirchhoff stress [Pa] of a trial state. `d` is the decomposition of F (unused for water).
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_and_stress(const MaterialParameters<T>& m, const Svd<T, D>& d, Mat<T, D>& F,
                                           T& internal) {
  if (m.model == MaterialModel::water) return Mat<T, D>::diagonal(Vec<T, D>::filled(water_stress(m, internal)));
  if (m.model == MaterialModel::snow) return snow_update(m, d, F, internal);
  if (m.model == MaterialModel::sand) return sand_update(m, d, F, internal);
  internal = determinant(F);
  return corotated_stress(m, T(1), d.U, d.sigma);
}

/// One step of a particle's deformation; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> update_material(const MaterialParameters<T>& m, T dt, const Mat<T, D>& C, Mat<T, D>& F,
                                            T& internal) {
  trial_deformation(m, dt, C, F, internal);
  return map_and_stress(m, needs_svd(m.model) ? svd(F) : Svd<T, D>{}, F, internal);
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
      return hencky_energy(m, logarithmic_strain(svd(F).sigma));
  }
  return T(0);
}

/// Sound speed [m/s] of the present state; never below that of the state at rest.
template <typename T, int D>
GRAUPEL_HD inline T sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T internal) {
  T c = m.elastic_speed;
  if (m.model == MaterialModel::water) c = water_sound_speed(m, internal);
  if (m.model == MaterialModel::jelly) c = jelly_sound_speed(m, F);
  if (m.model == MaterialModel::snow) c = snow_sound_speed(m, internal);
  return c > m.elastic_speed ? c : m.elastic_speed;
}

}  // namespace graupel::mpm
