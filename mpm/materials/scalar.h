// What a constitutive law is written over: a scalar S that is one number (float, double) or the numbers of several
// particles (Pack<T> of mpm/cpu/pack.h). A law decides by masks and select(), and may skip with any() what no lane
// needs. Constants of the material are numbers of the type Real<S>.
#pragma once

#include <cmath>
#include <concepts>

#include "core/math/polar.h"

namespace graupel::mpm {

template <typename S>
struct ScalarTypes {
  using Real = S;
  using Mask = bool;
  using Int = int;

  GRAUPEL_HD static int truncated(S a) { return static_cast<int>(a); }
  GRAUPEL_HD static S from_integer(int n) { return static_cast<S>(n); }
  /// The nearest of 0..last.
  GRAUPEL_HD static int limited(int n, int last) { return n < 0 ? 0 : n > last ? last : n; }
};
/// Type of one number of S; of the result of comparing two S; of integers, one for each number of S.
template <typename S>
using Real = typename ScalarTypes<S>::Real;
template <typename S>
using MaskOf = typename ScalarTypes<S>::Mask;
template <typename S>
using IntOf = typename ScalarTypes<S>::Int;

GRAUPEL_HD inline bool any(bool mask) { return mask; }

/// `a` where the mask is set, `b` elsewhere.
template <std::floating_point S>
GRAUPEL_HD inline S select(bool mask, S a, S b) {
  return mask ? a : b;
}
template <std::floating_point S>
GRAUPEL_HD inline S smaller(S a, S b) {
  return a < b ? a : b;
}
template <std::floating_point S>
GRAUPEL_HD inline S larger(S a, S b) {
  return a > b ? a : b;
}
template <std::floating_point S>
GRAUPEL_HD inline S magnitude(S a) {
  return std::abs(a);
}
template <std::floating_point S>
GRAUPEL_HD inline S square_root(S a) {
  return std::sqrt(a);
}
template <std::floating_point S>
GRAUPEL_HD inline S exponential(S a) {
  return std::exp(a);
}
template <std::floating_point S>
GRAUPEL_HD inline S logarithm(S a) {
  return std::log(a);
}
/// a^p of a positive a.
template <std::floating_point S>
GRAUPEL_HD inline S power(S a, S p) {
  return std::pow(a, p);
}

/// R of F = R S with det R = 1, for det F > 0; the identity otherwise.
template <std::floating_point S>
GRAUPEL_HD inline Mat<S, 3> rotation_of(const Mat<S, 3>& F) {
  return polar_rotation(F);
}
template <std::floating_point S>
GRAUPEL_HD inline Mat<S, 2> rotation_of(const Mat<S, 2>& F) {
  if (!(determinant(F) > S(0))) return Mat<S, 2>::identity();
  const S c = F(0, 0) + F(1, 1), s = F(1, 0) - F(0, 1), length = std::sqrt(c * c + s * s);
  return {{{c / length, -s / length}, {s / length, c / length}}};
}

template <typename S, int D>
GRAUPEL_HD inline S sum_of(const Vec<S, D>& values) {
  S sum = values[0];
  for (int i = 1; i < D; ++i) sum += values[i];
  return sum;
}

template <typename S, int D>
GRAUPEL_HD inline S product_of(const Vec<S, D>& values) {
  S product = values[0];
  for (int i = 1; i < D; ++i) product *= values[i];
  return product;
}

template <typename S, int D>
GRAUPEL_HD inline S length_of(const Vec<S, D>& values) {
  S sum = values[0] * values[0];
  for (int i = 1; i < D; ++i) sum += values[i] * values[i];
  return square_root(sum);
}

/// The values less `mean`.
template <typename S, int D>
GRAUPEL_HD inline Vec<S, D> deviator_of(const Vec<S, D>& values, S mean) {
  Vec<S, D> deviator;
  for (int i = 0; i < D; ++i) deviator[i] = values[i] - mean;
  return deviator;
}
template <typename S, int D>
GRAUPEL_HD inline Vec<S, D> deviator_of(const Vec<S, D>& values) {
  return deviator_of(values, sum_of(values) / Real<S>(D));
}

/// |F|^2 of the Frobenius norm.
template <typename S, int D>
GRAUPEL_HD inline S squared_norm(const Mat<S, D>& F) {
  S sum = F(0, 0) * F(0, 0);
  for (int i = 1; i < D * D; ++i) sum += F(i / D, i % D) * F(i / D, i % D);
  return sum;
}

/// U diag(values) U^T.
template <typename S, int D>
GRAUPEL_HD inline Mat<S, D> spectral(const Mat<S, D>& U, const Vec<S, D>& values) {
  Mat<S, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = r; c < D; ++c) {
      S s = U(r, 0) * values[0] * U(c, 0);
      for (int k = 1; k < D; ++k) s += U(r, k) * values[k] * U(c, k);
      m(r, c) = s;
      m(c, r) = s;
    }
  return m;
}

/// Upper bound of the largest squared singular value of F, exact where the others are equal (Wolkowicz and Styan 1980
/// for B = F F^T: tr B / D + sqrt((D - 1)/D) |dev B|).
template <typename S, int D>
GRAUPEL_HD inline S largest_stretch2_bound(const Mat<S, D>& F) {
  using T = Real<S>;
  S trace = S(T(0)), squares = S(T(0)), products = S(T(0));
  for (int r = 0; r < D; ++r) {
    S b = F(r, 0) * F(r, 0);
    for (int i = 1; i < D; ++i) b += F(r, i) * F(r, i);
    trace += b;
    squares += b * b;
    for (int c = 0; c < r; ++c) {
      S off = F(r, 0) * F(c, 0);
      for (int i = 1; i < D; ++i) off += F(r, i) * F(c, i);
      products += off * off;
    }
  }
  const S mean = trace / T(D), dev2 = squares + T(2) * products - T(D) * mean * mean;
  return mean + square_root(larger(dev2 * (T(D - 1) / T(D)), S(T(0))));
}

/// What of the deformation a law is a function of.
enum class Measure {
  nothing,       ///< no stress
  volume_ratio,  ///< J alone: mean_stress(m, J), viscous_stress(m, C, J), volume_ratio(I + dt C, J)
  deformation,   ///< F: update(m, F, internal) sets the internal variable and returns the Kirchhoff stress
  stretches,     ///< singular values of F: update(m, dt, stretches, internal, principal) moves them, sets the internal
                 ///< variable and the principal Kirchhoff stress, and returns the mask of the lanes that flowed
  logarithms     ///< the same of their logarithms
};

}  // namespace graupel::mpm
