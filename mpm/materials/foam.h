// Foam: StVK-Hencky elasticity with Herschel-Bulkley flow of dev tau = 2 mu dev(ln S) (the "foam" of warp-mpm, there
// with n = 1 and mu tr(F F^T)/3 for the flow's modulus, which would change the steady stress; here it is mu, so that
// the law holds exactly). The internal variable is the equivalent plastic strain; it does not act back.
#pragma once

#include "mpm/materials/hencky.h"
#include "mpm/materials/herschel_bulkley.h"

namespace graupel::mpm {

struct FoamLaw {
  static constexpr MaterialModel model = MaterialModel::foam;
  static constexpr Measure measure = Measure::logarithms;
  static constexpr double initial_internal = 0;  ///< e
  static constexpr bool keeps_volume_positive = false;
  static constexpr bool sound_speed_reads_F = true;

  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update(const MaterialParameters<Real<S>>& m, Real<S> dt, Vec<S, D>& strain, S& e,
                                     Vec<S, D>& principal) {
    using T = Real<S>;
    const Vec<S, D> deviator = deviator_of(strain);
    const S length = length_of(deviator), trial = T(2) * m.mu * length;
    const MaskOf<S> yields = trial > m.yield_strength;
    if (any(yields)) {
      const S zero = S(T(0)), flow = length * (T(1) - herschel_bulkley_stress(m, S(m.mu), dt, trial) / trial);
      const S flow_fraction = select(yields, flow / length, zero);
      for (int i = 0; i < D; ++i) strain[i] -= flow_fraction * deviator[i];
      e += select(yields, equivalent_strain<T> * flow, zero);
    }
    principal = hencky_principal_stress(m, strain);
    return yields;
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T) {
    return hencky_energy(m, logarithmic_strain(svd(F).sigma));
  }
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S) {
    return hencky_sound_speed(m, F, S(m.yield_strength));
  }
};

}  // namespace graupel::mpm
