// Metal and cake: StVK-Hencky elasticity with von Mises yield |dev tau| <= tau_Y = sqrt(2/3) sigma_Y and isotropic
// hardening (metal) or softening (cake) of sigma_Y with the equivalent plastic strain e = sqrt(2/3) sum |dev flow|
// (Simo and Hughes 1998, box 3.1, in logarithmic strains; NSF, appendix F.4, there tau_Y += 2 mu xi |flow|,
// tau_Y -= theta |flow|). Cake whose strength is used up is broken: it carries no stress for good (Wang et al. 2019).
#pragma once

#include "mpm/materials/hencky.h"
#include "mpm/materials/jelly.h"

namespace graupel::mpm {

/// tau_Y [Pa] at the equivalent plastic strain e; at or below 0 for broken cake.
template <typename T>
GRAUPEL_HD inline T von_mises_strength(const MaterialParameters<T>& m, T e) {
  return m.yield_strength + m.hardening_slope * e;
}

template <typename T>
GRAUPEL_HD inline bool is_broken(const MaterialParameters<T>& m, T e) {
  return m.model == MaterialModel::cake && !(von_mises_strength(m, e) > T(0));
}

/// Radial return of logarithmic strains; returns whether they changed. hardening_update after: to the yield surface of
/// the new e, exactly; before: to that of the old e, as NSF's explicit update does.
template <typename T, int D>
GRAUPEL_HD inline bool von_mises_return_mapping(const MaterialParameters<T>& m, Vec<T, D>& strain, T& e) {
  const Vec<T, D> deviator = deviator_of(strain);
  const T length = norm(deviator), strength = von_mises_strength(m, e);
  const T excess = length - (strength > T(0) ? strength : T(0)) / (T(2) * m.mu);
  if (!(excess > T(0))) return false;
  const T root = T(0.81649658092772603), softness = root * m.hardening_slope / (T(2) * m.mu);  // sqrt(2/3)
  const T rate = m.hardening_update == HardeningUpdate::after ? T(1) + softness : T(1);
  const T flow = excess < rate * length ? excess / rate : length;
  strain -= (flow / length) * deviator;
  e += root * flow;
  return true;
}

/// One step from the decomposition `d` of the trial F -> elastic F, e; returns the Kirchhoff stress [Pa].
template <typename T, int D>
GRAUPEL_HD inline Mat<T, D> von_mises_update(const MaterialParameters<T>& m, const Svd<T, D>& d, Mat<T, D>& F, T& e) {
  Vec<T, D> strain = logarithmic_strain(d.sigma);
  if (!is_broken(m, e) && (von_mises_return_mapping(m, strain, e) || is_collapsed(d.sigma)))
    F = deformation_of_strain(d, strain);
  if (is_broken(m, e)) {  // pieces forget their strain, so that F stays a rotation
    F = d.U * transpose(d.V);
    return Mat<T, D>::zero();
  }
  if (m.model == MaterialModel::metal || m.elasticity == Elasticity::hencky) return hencky_stress(m, d.U, strain);
  for (int i = 0; i < D; ++i) strain[i] = std::exp(strain[i]);
  return corotated_stress(m, T(1), d.U, strain);
}

template <typename T, int D>
GRAUPEL_HD inline T von_mises_energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T e) {
  if (is_broken(m, e)) return T(0);
  const Vec<T, D> sigma = svd(F).sigma;
  if (m.model == MaterialModel::cake && m.elasticity == Elasticity::corotated) return corotated_energy(m, T(1), sigma);
  return hencky_energy(m, logarithmic_strain(sigma));
}

/// Upper estimate of the wave speed [m/s]; 0 for broken cake.
template <typename T, int D>
GRAUPEL_HD inline T von_mises_sound_speed(const MaterialParameters<T>& m, const Mat<T, D>& F, T e) {
  if (is_broken(m, e)) return T(0);
  if (m.model == MaterialModel::cake && m.elasticity == Elasticity::corotated)
    return jelly_sound_speed(m, F, determinant(F));
  return hencky_sound_speed(m, F, von_mises_strength(m, e));
}

}  // namespace graupel::mpm
