// Toothpaste: neo-Hookean with a separate volume term, psi = K/2 ((J^2 - 1)/2 - ln J) + mu/2 (tr b_ - D),
// tau = K/2 (J^2 - 1) I + s, s = mu dev b_, b_ = J^(-2/D) F F^T, and Herschel-Bulkley flow of s (Yue et al. 2015; NSF,
// appendix F.5, with the update of the elastic F that NSF leaves out: Simo and Hughes 1998, box 9.1). J is kept: the
// mean of the new b_ is that which makes det b_ = 1.
#pragma once

#include "core/math/svd.h"
#include "mpm/materials/herschel_bulkley.h"

namespace graupel::mpm {

/// The m > 0 with prod (a_i + m) = 1 for deviatoric a, from a start above it, where the product is convex.
template <typename S>
GRAUPEL_HD inline S unimodular_mean(const Vec<S, 2>& a, S) {
  return square_root(Real<S>(1) + a[0] * a[0]);
}
template <typename S>
GRAUPEL_HD inline S unimodular_mean(const Vec<S, 3>& a, S above) {
  using T = Real<S>;
  const S second = a[0] * a[1] + a[1] * a[2] + a[2] * a[0], third = a[0] * a[1] * a[2];
  constexpr T precise = sizeof(T) == 4 ? T(1e-4) : T(1e-8);  // of the last step; the error is its square
  S mean = above;
  for (int i = 0; i < 40; ++i) {
    const S step = (((mean * mean + second) * mean + third) - T(1)) / (T(3) * mean * mean + second);
    mean -= step;
    if (!any(magnitude(step) > precise * mean)) break;
  }
  return mean;
}

template <typename T, int D>
GRAUPEL_HD inline T toothpaste_energy(const MaterialParameters<T>& m, const Mat<T, D>& F) {
  const T J = determinant(F), bulk = m.lambda + T(2) * m.mu / T(D);
  return T(0.5) * (bulk * (T(0.5) * (J * J - T(1)) - std::log(J)) +
                   m.mu * (std::pow(J, T(-2) / T(D)) * double_dot(F, F) - T(D)));
}

struct ToothpasteLaw {
  static constexpr MaterialModel model = MaterialModel::toothpaste;
  static constexpr Measure measure = Measure::stretches;
  static constexpr double initial_internal = 1;        ///< J
  static constexpr bool keeps_volume_positive = true;  ///< an inverted F has no stress, and ends the run
  static constexpr bool sound_speed_reads_F = true;

  template <typename S, int D>
  GRAUPEL_HD static MaskOf<S> update(const MaterialParameters<Real<S>>& m, Real<S> dt, Vec<S, D>& sigma, S& J,
                                     Vec<S, D>& principal) {
    using T = Real<S>;
    J = product_of(sigma);
    const MaskOf<S> upright = J > T(0);
    const S isochoric = power(select(upright, J, S(T(1))), T(-2) / T(D));
    Vec<S, D> b;
    for (int i = 0; i < D; ++i) b[i] = isochoric * sigma[i] * sigma[i];
    const S mean = sum_of(b) / T(D);
    Vec<S, D> deviator = deviator_of(b, mean);
    const S trial = m.mu * length_of(deviator);
    const MaskOf<S> yields = upright & (trial > m.yield_strength);
    if (any(yields)) {
      const S flow = herschel_bulkley_stress(m, m.mu * mean, dt, trial), kept = select(yields, flow / trial, S(T(1)));
      for (int i = 0; i < D; ++i) deviator[i] *= kept;
      const S new_mean = unimodular_mean(deviator, mean);
      for (int i = 0; i < D; ++i)
        sigma[i] = select(yields, square_root((deviator[i] + new_mean) / isochoric), sigma[i]);
    }
    const S volumetric = T(0.5) * (m.lambda + T(2) * m.mu / T(D)) * (J * J - T(1));
    for (int i = 0; i < D; ++i) principal[i] = select(upright, m.mu * deviator[i] + volumetric, S(T(0)));
    return yields;
  }
  template <typename T, int D>
  GRAUPEL_HD static T energy(const MaterialParameters<T>& m, const Mat<T, D>& F, T) {
    return toothpaste_energy(m, F);
  }
  /// Upper estimate: K/2 (J^2 + 1) of the volume term and 2 mu (D - 1)/D of the largest isochoric stretch (exact at
  /// rest).
  template <typename S, int D>
  GRAUPEL_HD static S sound_speed(const MaterialParameters<Real<S>>& m, const Mat<S, D>& F, S J) {
    using T = Real<S>;
    const S stretch2 = power(J, T(-2) / T(D)) * largest_stretch2_bound(F);
    const T bulk = m.lambda + T(2) * m.mu / T(D);
    return square_root((T(0.5) * bulk * (J * J + T(1)) + T(2) * m.mu * T(D - 1) / T(D) * stretch2) / m.density);
  }
};

}  // namespace graupel::mpm
