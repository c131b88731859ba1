// 3 x 3 matrices, one in every lane: rotation by Newton's method (core/math/polar.h) and eigenvectors of symmetric
// matrices.
#pragma once

#include "mpm/cpu/lanes.h"

namespace graupel::mpm {
namespace {

template <typename T>
struct LaneMatrix {
  Lanes<T> m[3][3];
};
/// xx, yy, zz, xy, xz, yz, as tiles keep them.
template <typename T>
struct LaneSymmetric {
  Lanes<T> s[6];
};
/// Where entry (r, c) is in LaneSymmetric.
constexpr int symmetric_entry(int r, int c) { return r == c ? r : r + c + 2; }

template <typename T>
GRAUPEL_LANES LaneMatrix<T> product(const LaneMatrix<T>& a, const LaneMatrix<T>& b) {
  LaneMatrix<T> p;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) p.m[r][c] = a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c];
  return p;
}
template <typename T>
GRAUPEL_LANES Lanes<T> determinant_of(const LaneMatrix<T>& a) {
  return a.m[0][0] * (a.m[1][1] * a.m[2][2] - a.m[1][2] * a.m[2][1]) -
         a.m[0][1] * (a.m[1][0] * a.m[2][2] - a.m[1][2] * a.m[2][0]) +
         a.m[0][2] * (a.m[1][0] * a.m[2][1] - a.m[1][1] * a.m[2][0]);
}
template <typename T>
GRAUPEL_LANES Lanes<T> squares(const LaneMatrix<T>& a) {
  Lanes<T> sum = a.m[0][0] * a.m[0][0];
  for (int i = 1; i < 9; ++i) sum += a.m[i / 3][i % 3] * a.m[i / 3][i % 3];
  return sum;
}
/// F F^T.
template <typename T>
GRAUPEL_LANES LaneSymmetric<T> left_stretch2(const LaneMatrix<T>& F) {
  LaneSymmetric<T> b;
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c)
      b.s[symmetric_entry(r, c)] = F.m[r][0] * F.m[c][0] + F.m[r][1] * F.m[c][1] + F.m[r][2] * F.m[c][2];
  return b;
}

/// Rotation of F in lanes with det F > 0, the identity in others. Scaling waits for a matrix that needs it: near a
/// rotation Newton's steps square the error without.
template <typename T>
GRAUPEL_LANES LaneMatrix<T> rotation_of(const LaneMatrix<T>& F) {
  constexpr T small = sizeof(T) == 4 ? T(1e-7) : T(1e-15);
  LaneMatrix<T> X = F;
  Mask<T> inverted = Mask<T>{};
  for (int i = 0; i < 20; ++i) {
    LaneMatrix<T> C;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
        C.m[r][c] = X.m[r1][c1] * X.m[r2][c2] - X.m[r1][c2] * X.m[r2][c1];
      }
    const Lanes<T> det = X.m[0][0] * C.m[0][0] + X.m[0][1] * C.m[0][1] + X.m[0][2] * C.m[0][2];
    if (i == 0) inverted = ~(det > T(0));
    const Lanes<T> lengths2 = squares(X), off = lengths2 - T(3);
    Lanes<T> a = splat(T(0.5)), b = T(0.5) / det;
    if (any(off * off > T(0.09))) {
      const Lanes<T> g = square_root(square_root(squares(C) / lengths2) / det);
      a = T(0.5) * g;
      b = T(0.5) / (g * det);
    }
    Lanes<T> change2 = Lanes<T>{};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        const Lanes<T> next = a * X.m[r][c] + b * C.m[r][c], change = next - X.m[r][c];
        change2 += change * change;
        X.m[r][c] = next;
      }
    if (!any(~inverted & (change2 > small))) break;
  }
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) X.m[r][c] = inverted ? splat(r == c ? T(1) : T(0)) : X.m[r][c];
  return X;
}

/// The smallest normal number.
template <typename T>
constexpr T tiny = sizeof(T) == 4 ? T(1.17549435e-38) : T(2.2250738585072014e-308);

/// Jacobi's rotation that makes entry (p, q) vanish, p < q, r the third axis (Golub and Van Loan, section 8.5).
template <typename T, int p, int q>
GRAUPEL_LANES void rotate(LaneSymmetric<T>& A, LaneMatrix<T>& U) {
  constexpr int r = 3 - p - q;
  Lanes<T>&pp = A.s[p], &qq = A.s[q], &pq = A.s[symmetric_entry(p, q)];
  Lanes<T>&pr = A.s[symmetric_entry(p, r)], &qr = A.s[symmetric_entry(q, r)];
  const Lanes<T> d = qq - pp, twice = pq + pq;
  const Lanes<T> root = square_root(d * d + twice * twice) + tiny<T>;
  const Lanes<T> t = twice / (d >= T(0) ? d + root : d - root);
  const Lanes<T> c = T(1) / square_root(t * t + T(1)), s = c * t;
  pp -= t * pq;
  qq += t * pq;
  pq = Lanes<T>{};
  const Lanes<T> old = pr;
  pr = c * old - s * qr;
  qr = s * old + c * qr;
  for (int i = 0; i < 3; ++i) {
    const Lanes<T> up = U.m[i][p], uq = U.m[i][q];
    U.m[i][p] = c * up - s * uq;
    U.m[i][q] = s * up + c * uq;
  }
}

/// Eigenvalues of A (on its diagonal afterwards) and eigenvectors (columns of U).
template <typename T>
GRAUPEL_LANES LaneMatrix<T> eigenvectors(LaneSymmetric<T>& A) {
  constexpr T small = sizeof(T) == 4 ? T(1e-15) : T(1e-33);  // squared, against the trace
  LaneMatrix<T> U;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) U.m[r][c] = splat(r == c ? T(1) : T(0));
  for (int sweep = 0; sweep < 8; ++sweep) {
    const Lanes<T> off = A.s[3] * A.s[3] + A.s[4] * A.s[4] + A.s[5] * A.s[5], sum = A.s[0] + A.s[1] + A.s[2];
    if (!any(off > small * sum * sum)) break;
    rotate<T, 0, 1>(A, U);
    rotate<T, 0, 2>(A, U);
    rotate<T, 1, 2>(A, U);
  }
  return U;
}

/// U diag(values) U^T.
template <typename T>
GRAUPEL_LANES LaneSymmetric<T> from_spectrum(const LaneMatrix<T>& U, const Lanes<T> (&values)[3]) {
  LaneSymmetric<T> A;
  for (int r = 0; r < 3; ++r) {
    const Lanes<T> a = U.m[r][0] * values[0], b = U.m[r][1] * values[1], c = U.m[r][2] * values[2];
    for (int k = r; k < 3; ++k) A.s[symmetric_entry(r, k)] = a * U.m[k][0] + b * U.m[k][1] + c * U.m[k][2];
  }
  return A;
}
/// A F of a symmetric A.
template <typename T>
GRAUPEL_LANES LaneMatrix<T> product(const LaneSymmetric<T>& A, const LaneMatrix<T>& F) {
  LaneMatrix<T> p;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      p.m[r][c] = A.s[symmetric_entry(r, 0)] * F.m[0][c] + A.s[symmetric_entry(r, 1)] * F.m[1][c] +
                  A.s[symmetric_entry(r, 2)] * F.m[2][c];
  return p;
}

}  // namespace
}  // namespace graupel::mpm
