// Singular value decomposition of small matrices by one-sided Jacobi rotations, for host and device.
// F = U diag(sigma) V^T with U and V proper rotations (det = +1), so that an inverted F has a negative last singular
// value: the convention of finite-strain plasticity (Irving, Teran and Fedkiw 2004, "Invertible finite elements").
// One-sided Jacobi: Golub and Van Loan, Matrix Computations, 4th ed., section 8.6.3.
#pragma once

#include "core/math/mat.h"

namespace graupel {

template <typename T, int D>
struct Svd {
  Mat<T, D> U;
  Vec<T, D> sigma;  ///< descending in magnitude; only the last may be negative
  Mat<T, D> V;
};

/// Decomposition of F. Relative accuracy about 10 machine epsilons; a zero matrix gives U = V = I.
template <typename T, int D>
GRAUPEL_HD inline Svd<T, D> svd(const Mat<T, D>& F) {
  static_assert(D == 2 || D == 3);
  // B = F V has orthogonal columns once the rotations have converged.
  Mat<T, D> B = F, V = Mat<T, D>::identity();
  constexpr int sweeps = sizeof(T) == 4 ? 5 : 8;
  constexpr T tolerance = sizeof(T) == 4 ? T(1e-7) : T(1e-15);
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bool rotated = false;
    for (int p = 0; p < D - 1; ++p)
      for (int q = p + 1; q < D; ++q) {
        T alpha = 0, beta = 0, gamma = 0;
        for (int r = 0; r < D; ++r) {
          alpha += B(r, p) * B(r, p);
          beta += B(r, q) * B(r, q);
          gamma += B(r, p) * B(r, q);
        }
        if (!(std::abs(gamma) > tolerance * std::sqrt(alpha * beta))) continue;
        rotated = true;
        const T zeta = (beta - alpha) / (T(2) * gamma);
        const T t = (zeta >= T(0) ? T(1) : T(-1)) / (std::abs(zeta) + std::sqrt(T(1) + zeta * zeta));
        const T c = T(1) / std::sqrt(T(1) + t * t), s = c * t;
        for (int r = 0; r < D; ++r) {
          const T bp = B(r, p), bq = B(r, q), vp = V(r, p), vq = V(r, q);
          B(r, p) = c * bp - s * bq;
          B(r, q) = s * bp + c * bq;
          V(r, p) = c * vp - s * vq;
          V(r, q) = s * vp + c * vq;
        }
      }
    if (!rotated) break;
  }
  Svd<T, D> result;
  // Sort the columns by length, keeping V a rotation (a swap with one sign change).
  Vec<T, D> length;
  for (int c = 0; c < D; ++c) {
    T s = 0;
    for (int r = 0; r < D; ++r) s += B(r, c) * B(r, c);
    length[c] = std::sqrt(s);
  }
  for (int i = 0; i < D - 1; ++i)
    for (int j = 0; j < D - 1 - i; ++j)
      if (length[j] < length[j + 1]) {
        const T l = length[j];
        length[j] = length[j + 1];
        length[j + 1] = l;
        for (int r = 0; r < D; ++r) {
          T x = B(r, j);
          B(r, j) = B(r, j + 1);
          B(r, j + 1) = -x;
          x = V(r, j);
          V(r, j) = V(r, j + 1);
          V(r, j + 1) = -x;
        }
      }
  // U: normalised columns; the last one completes a right-handed frame, which also serves rank-deficient F.
  result.V = V;
  Mat<T, D>& U = result.U;
  if constexpr (D == 2) {
    const bool ok = length[0] > T(0);
    U(0, 0) = ok ? B(0, 0) / length[0] : T(1);
    U(1, 0) = ok ? B(1, 0) / length[0] : T(0);
    U(0, 1) = -U(1, 0);
    U(1, 1) = U(0, 0);
  } else {
    Vec<T, 3> u0 = length[0] > T(0) ? Vec<T, 3>{B(0, 0), B(1, 0), B(2, 0)} * (T(1) / length[0]) : Vec<T, 3>{1, 0, 0};
    Vec<T, 3> u1;
    if (length[1] > T(1e-6) * length[0]) {
      u1 = Vec<T, 3>{B(0, 1), B(1, 1), B(2, 1)} * (T(1) / length[1]);
    } else {  // any unit vector perpendicular to u0
      const Vec<T, 3> e = std::abs(u0[0]) < T(0.6) ? Vec<T, 3>{1, 0, 0} : Vec<T, 3>{0, 1, 0};
      u1 = normalized(cross(u0, e));
    }
    const Vec<T, 3> u2 = cross(u0, u1);
    for (int r = 0; r < 3; ++r) {
      U(r, 0) = u0[r];
      U(r, 1) = u1[r];
      U(r, 2) = u2[r];
    }
  }
  for (int c = 0; c < D; ++c) {
    T s = 0;
    for (int r = 0; r < D; ++r) s += U(r, c) * B(r, c);
    result.sigma[c] = s;
  }
  return result;
}

}  // namespace graupel
