// One step of any material: deformation, return mapping, stress; chosen by the material's model.
//
// A particle keeps the elastic deformation gradient F (identity for fluids and stationary particles) and one internal
// variable:
//   J = det F          water, jelly, neo_hookean, toothpaste
//   J_p                snow: volume ratio of the plastic flow
//   v_c                sand: logarithmic volume gained in tension
//   plastic strain     metal, cake, foam: equivalent, sqrt(2/3) sum |dev flow|
//   none (0)           stationary
#pragma once

#include "mpm/materials/list.h"

namespace graupel::mpm {

/// Whether the internal variable is a volume ratio that must stay positive; plastic models repair F instead.
GRAUPEL_HD inline bool internal_variable_is_volume_ratio(MaterialModel model) {
  bool result = false;
  with_law(model, [&](auto law) { result = decltype(law)::keeps_volume_positive; });
  return result;
}

/// Value of the internal variable in the undeformed state.
GRAUPEL_HD inline double initial_internal_variable(MaterialModel model) {
  double result = 0;
  with_law(model, [&](auto law) { result = decltype(law)::initial_internal; });
  return result;
}

GRAUPEL_HD inline Measure measure_of(MaterialModel model) {
  Measure result = Measure::nothing;
  with_law(model, [&](auto law) { result = decltype(law)::measure; });
  return result;
}

/// Whether F is part of the particle's state.
GRAUPEL_HD inline bool keeps_deformation(MaterialModel model) {
  return !is_fluid(model) && !has_measure<Measure::nothing>(model);
}

constexpr GRAUPEL_HD bool is_principal(Measure measure) {
  return measure == Measure::stretches || measure == Measure::logarithms;
}

/// Whether the model works on the singular values of F.
GRAUPEL_HD inline bool needs_svd(MaterialModel model) { return is_principal(measure_of(model)); }

/// Trial state of a step with the affine velocity C [1/s]: F <- (I + dt C) F, fluids J <- det(I + dt C) J.
template <typename T, int D>
GRAUPEL_HD inline void trial_deformation(const MaterialParameters<T>& m, T dt, const Mat<T, D>& C, Mat<T, D>& F,
                                         T& internal) {
  const Mat<T, D> increment = Mat<T, D>::identity() + dt * C;
  if (is_fluid(m.model))
    with_fluid(m.model, [&](auto law) { internal = decltype(law)::volume_ratio(increment, internal); });
  else if (keeps_deformation(m.model))
    F = increment * F;
}

/// F = U diag(sigma) V^T.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> deformation_of_stretches(const Svd<T, D>& d, const Vec<T, D>& sigma) {
  return d.U * Mat<T, D>::diagonal(sigma) * transpose(d.V);
}

/// Return mapping and stress of a law of singular values or their logarithms, from the decomposition `d` of the trial
/// F.
template <typename Law, typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_principal(const MaterialParameters<T>& m, T dt, const Svd<T, D>& d, Mat<T, D>& F,
                                          T& internal) {
  Vec<T, D> principal;
  if constexpr (Law::measure == Measure::logarithms) {
    Vec<T, D> strain = logarithmic_strain(d.sigma);
    if (Law::update(m, dt, strain, internal, principal) || is_collapsed(d.sigma)) {
      for (int i = 0; i < D; ++i) strain[i] = std::exp(strain[i]);
      F = deformation_of_stretches(d, strain);
    }
  } else {
    Vec<T, D> sigma = d.sigma;
    if (Law::update(m, dt, sigma, internal, principal)) F = deformation_of_stretches(d, sigma);
  }
  return spectral(d.U, principal);
}

/// Of the laws that are not frequent, by value, so that a caller's own copies of the others' state can stay in
/// registers.
template <typename T, int D>
GRAUPEL_COLD GRAUPEL_HD Mat<T, D> map_principal_of_others(const MaterialParameters<T>& m, T dt, Svd<T, D> d,
                                                          Mat<T, D>& F, T& internal) {
  Mat<T, D> tau = Mat<T, D>::zero();
  with_law(OtherLaws{}, m.model, [&](auto law) {
    using Law = decltype(law);
    if constexpr (is_principal(Law::measure)) tau = map_principal<Law>(m, dt, d, F, internal);
  });
  return tau;
}

/// Return mapping and Kirchhoff stress [Pa] of a trial state, viscosity of fluids excepted. `d` is the decomposition of
/// F (unused where needs_svd() is false), `dt` the step that led to it [s].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_and_stress(const MaterialParameters<T>& m, T dt, const Svd<T, D>& d, Mat<T, D>& F,
                                           T& internal) {
  Mat<T, D> tau = Mat<T, D>::zero();
  const auto map = [&](auto law) {
    using Law = decltype(law);
    if constexpr (Law::measure == Measure::volume_ratio)
      tau = Mat<T, D>::diagonal(Vec<T, D>::filled(Law::mean_stress(m, internal)));
    else if constexpr (Law::measure == Measure::deformation)
      tau = Law::update(m, F, internal);
    else if constexpr (is_principal(Law::measure))
      tau = map_principal<Law>(m, dt, d, F, internal);
  };
  if (with_law(FrequentLaws{}, m.model, map)) return tau;
  if (measure_of(m.model) == Measure::deformation) {
    with_law(OtherLaws{}, m.model, [&](auto law) {
      using Law = decltype(law);
      if constexpr (Law::measure == Measure::deformation) tau = Law::update(m, F, internal);
    });
    return tau;
  }
  Mat<T, D> F_of_others = F;
  T internal_of_others = internal;
  tau = map_principal_of_others(m, dt, d, F_of_others, internal_of_others);
  F = F_of_others;
  internal = internal_of_others;
  return tau;
}

/// map_and_stress() of one solid particle, which decomposes F where its model needs it.
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> map_and_stress_of_solid(const MaterialParameters<T>& m, T dt, Mat<T, D>& F, T& internal) {
  if (m.model == JellyLaw::model) return JellyLaw::update(m, F, internal);
  return map_and_stress(m, dt, needs_svd(m.model) ? svd(F) : Svd<T, D>{}, F, internal);
}

/// Kirchhoff stress [Pa] of a fluid without its viscosity: this times the identity.
template <typename S>
GRAUPEL_HD inline S fluid_mean_stress(const MaterialParameters<Real<S>>& m, S internal) {
  S stress{};
  with_fluid(m.model, [&](auto law) { stress = decltype(law)::mean_stress(m, internal); });
  return stress;
}

/// Kirchhoff stress [Pa] of fluids and stationary particles.
template <typename S, int D>
GRAUPEL_HD inline Mat<S, D> fluid_stress(const MaterialParameters<Real<S>>& m, const Mat<S, D>& C, S internal) {
  if (!is_fluid(m.model)) return Mat<S, D>::zero();
  Mat<S, D> tau = Mat<S, D>::diagonal(Vec<S, D>::filled(fluid_mean_stress(m, internal)));
  if (m.viscosity > Real<S>(0)) tau += viscous_stress(m, C, internal);
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
  T energy = 0;
  with_law(m.model, [&](auto law) { energy = decltype(law)::energy(m, F, internal); });
  return energy;
}

/// Whether sound_speed() reads F.
GRAUPEL_HD inline bool sound_speed_needs_deformation(MaterialModel model) {
  bool result = false;
  with_law(model, [&](auto law) { result = decltype(law)::sound_speed_reads_F; });
  return result;
}

/// sound_speed() of the laws that are not frequent.
template <typename T, int D>
GRAUPEL_COLD GRAUPEL_HD T sound_speed_of_others(const MaterialParameters<T>& m, Mat<T, D> F, T internal) {
  T c = m.elastic_speed;
  with_law(OtherLaws{}, m.model, [&](auto law) { c = decltype(law)::sound_speed(m, F, internal); });
  return c;
}

/// Sound speed [m/s] of the present state; never below that of the state at rest.
template <typename T, int D>
GRAUPEL_HD inline T sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T internal) {
  T c = m.elastic_speed;
  if (!with_law(FrequentLaws{}, m.model, [&](auto law) { c = decltype(law)::sound_speed(m, F, internal); }))
    c = sound_speed_of_others(m, F, internal);
  return c > m.elastic_speed ? c : m.elastic_speed;
}

}  // namespace graupel::mpm
