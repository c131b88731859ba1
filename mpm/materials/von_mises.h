// Metal and cake: StVK-Hencky elasticity with von Mises yield |dev tau| <= tau_Y = sqrt(2/3) sigma_Y and isotropic
// hardening (metal) or softening (cake) of sigma_Y with the equivalent plastic strain e = sqrt(2/3) sum |dev flow|
// (Simo and Hughes 1998, box 3.1, in logarithmic strains; NSF, appendix F.4, there tau_Y += 2 mu xi |flow|,
// tau_Y -= theta |flow|). Cake whose strength is used up is broken: it carries no stress for good (Wang et al. 2019).
#pragma once

#include "mpm/materials/hencky.h"
#include "mpm/materials/jelly.h"

namespace graupel::mpm {

/// tau_Y [Pa] at the equivalent plastic strain e; at or below 0 for broken cake.
template <typename S>
GRAUPEL_HD inline S von_mises_strength(const MaterialParameters<Real<S>>& m, S e) {
  return m.yield_strength + m.hardening_slope * e;
}

template <typename S>
GRAUPEL_HD inline MaskOf<S> is_broken(const MaterialParameters<Real<S>>& m, S e) {
  if (m.model != MaterialModel::cake) return MaskOf<S>(false);
  return !(von_mises_strength(m, e) > Real<S>(0));
}

/// Radial return of logarithmic strains; returns whether they changed. hardening_update after: to the yield surface of
/// the new e, exactly; before: to that of the old e, as NSF's explicit update does.
template <typename S, int D>
GRAUPEL_HD inline MaskOf<S> von_mises_return_mapping(const MaterialParameters<Real<S>>& m, Vec<S, D>& strain, S& e) {
  using T = Real<S>;
  const S zero = S(T(0));
  const Vec<S, D> deviator = deviator_of(strain);
  const S length = length_of(deviator), strength = von_mises_strength(m, e);
  const S excess = length - larger(strength, zero) / (T(2) * m.mu);
  const MaskOf<S> yields = excess > T(0);
  if (!any(yields)) return yields;
  const T softness = equivalent_strain<T> * m.hardening_slope / (T(2) * m.mu);
  const T rate = m.hardening_update == HardeningUpdate::after ? T(1) + softness : T(1);
  const S flow = select(excess < rate * length, excess / rate, length);
  const S flow_fraction = select(yields, flow / length, zero);
  for (int i = 0; i < D; ++i) strain[i] -= flow_fraction * deviator[i];
  e += select(yields, equivalent_strain<T> * flow, zero);
  return yields;
}

template <MaterialModel Model>
struct VonMisesLaw {
  static constexpr MaterialModel model = Model;
  static constexpr Measure measure = Measure::logarithms;
  static constexpr double initial_internal = 0;  ///< e
  static constexpr bool keeps_volume_positive = false;
  static constexpr bool sound_speed_reads_F = true;

  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update(const MaterialParameters<Real<S>>& m, Real<S>, Vec<S, D>& strain, S& e,
                                     Vec<S, D>& principal) {
    if constexpr (Model == MaterialModel::metal) {
      const MaskOf<S> yields = von_mises_return_mapping(m, strain, e);
      principal = hencky_principal_stress(m, strain);
      return yields;
    } else {
      return update_cake(m, strain, e, principal);
    }
  }
  /// Yields and breaks; broken pieces forget their strain, so that F stays a rotation.
  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update_cake(const MaterialParameters<Real<S>>& m, Vec<S, D>& strain, S& e,
                                          Vec<S, D>& principal) {
    const S zero = S(Real<S>(0)), old = e;
    const MaskOf<S> was_broken = is_broken(m, e), yields = von_mises_return_mapping(m, strain, e);
    e = select(was_broken, old, e);
    const MaskOf<S> broken = is_broken(m, e);
    if (m.elasticity == Elasticity::hencky) {
      principal = hencky_principal_stress(m, strain);
    } else {
      Vec<S, D> sigma;
      for (int i = 0; i < D; ++i) sigma[i] = exponential(strain[i]);
      principal = corotated_principal_stress(m, S(Real<S>(1)), sigma);
    }
    for (int i = 0; i < D; ++i) {
      strain[i] = select(broken, zero, strain[i]);
      principal[i] = select(broken, zero, principal[i]);
    }
    return yields | broken;
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T e) {
    if (is_broken(m, e)) return T(0);
    const Vec<T, D> sigma = svd(F).sigma;
    if (Model == MaterialModel::cake && m.elasticity == Elasticity::corotated) return corotated_energy(m, T(1), sigma);
    return hencky_energy(m, logarithmic_strain(sigma));
  }
  /// Upper estimate; 0 for broken cake.
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S e) {
    const S whole = Model == MaterialModel::cake && m.elasticity == Elasticity::corotated
                        ? jelly_sound_speed(m, F, determinant(F))
                        : hencky_sound_speed(m, F, von_mises_strength(m, e));
    return select(is_broken(m, e), S(Real<S>(0)), whole);
  }
};
using MetalLaw = VonMisesLaw<MaterialModel::metal>;
using CakeLaw = VonMisesLaw<MaterialModel::cake>;

}  // namespace graupel::mpm
