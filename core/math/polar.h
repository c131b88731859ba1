// Rotation of the polar decomposition F = R S by Newton's method with Frobenius scaling, for host and device:
//   X <- (g X + X^-T / g) / 2,   g^2 = |X^-T| / |X|,   X_0 = F
// (Higham 1986, "Computing the Polar Decomposition - with Applications", SIAM J. Sci. Stat. Comput. 7).
#pragma once

#include "core/math/mat.h"

namespace graupel {

/// det(m) m^-T.
template <typename T>
GRAUPEL_HD inline Mat<T, 3> cofactors(const Mat<T, 3>& m) {
  Mat<T, 3> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      c(i, j) = m(i1, j1) * m(i2, j2) - m(i1, j2) * m(i2, j1);
    }
  return c;
}

/// R with det R = 1, for det F > 0; the identity otherwise.
template <typename T>
GRAUPEL_HD inline Mat<T, 3> polar_rotation(const Mat<T, 3>& F) {
  constexpr T small = sizeof(T) == 4 ? T(1e-7) : T(1e-15);  // squared change after which the next is rounding
  Mat<T, 3> X = F;
  for (int i = 0; i < 20; ++i) {
    const Mat<T, 3> inverse = cofactors(X);
    const T det = X(0, 0) * inverse(0, 0) + X(0, 1) * inverse(0, 1) + X(0, 2) * inverse(0, 2);
    if (!(det > T(0))) return Mat<T, 3>::identity();
    const T g2 = std::sqrt(double_dot(inverse, inverse) / double_dot(X, X)) / det;
    const T g = std::sqrt(g2), a = T(0.5) * g, b = T(0.5) / (g * det);
    T change2 = 0;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        const T next = a * X(r, c) + b * inverse(r, c), change = next - X(r, c);
        change2 += change * change;
        X(r, c) = next;
      }
    if (change2 < small) break;
  }
  return X;
}

}  // namespace graupel
