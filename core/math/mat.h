// Small square matrices, row-major, for host and device.
#pragma once

#include "core/math/vec.h"

namespace graupel {

/// D x D matrix; `m(r, c)` is row r, column c.
template <typename T, int D>
struct Mat {
  T a[D][D];

  GRAUPEL_HD T& operator()(int r, int c) { return a[r][c]; }
  GRAUPEL_HD const T& operator()(int r, int c) const { return a[r][c]; }

  GRAUPEL_HD static Mat zero() {
    Mat m;
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) m.a[r][c] = T(0);
    return m;
  }
  GRAUPEL_HD static Mat diagonal(const Vec<T, D>& d) {
    Mat m = zero();
    for (int i = 0; i < D; ++i) m.a[i][i] = d[i];
    return m;
  }
  GRAUPEL_HD static Mat identity() { return diagonal(Vec<T, D>::filled(T(1))); }

  GRAUPEL_HD Mat& operator+=(const Mat& o) {
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) a[r][c] += o.a[r][c];
    return *this;
  }
  GRAUPEL_HD Mat& operator-=(const Mat& o) {
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) a[r][c] -= o.a[r][c];
    return *this;
  }
  GRAUPEL_HD Mat& operator*=(T s) {
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) a[r][c] *= s;
    return *this;
  }
  template <typename U>
  GRAUPEL_HD Mat<U, D> cast() const {
    Mat<U, D> m;
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) m.a[r][c] = static_cast<U>(a[r][c]);
    return m;
  }
};

template <typename T, int D>
GRAUPEL_HD Mat<T, D> operator+(Mat<T, D> x, const Mat<T, D>& y) {
  return x += y;
}
template <typename T, int D>
GRAUPEL_HD Mat<T, D> operator-(Mat<T, D> x, const Mat<T, D>& y) {
  return x -= y;
}
template <typename T, int D>
GRAUPEL_HD Mat<T, D> operator*(Mat<T, D> x, T s) {
  return x *= s;
}
template <typename T, int D>
GRAUPEL_HD Mat<T, D> operator*(T s, Mat<T, D> x) {
  return x *= s;
}
template <typename T, int D>
GRAUPEL_HD Mat<T, D> operator*(const Mat<T, D>& x, const Mat<T, D>& y) {
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) {
      T s = 0;
      for (int k = 0; k < D; ++k) s += x.a[r][k] * y.a[k][c];
      m.a[r][c] = s;
    }
  return m;
}
template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator*(const Mat<T, D>& x, const Vec<T, D>& v) {
  Vec<T, D> y;
  for (int r = 0; r < D; ++r) {
    T s = 0;
    for (int c = 0; c < D; ++c) s += x.a[r][c] * v.a[c];
    y.a[r] = s;
  }
  return y;
}
template <typename T, int D>
GRAUPEL_HD Mat<T, D> transpose(const Mat<T, D>& x) {
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) m.a[r][c] = x.a[c][r];
  return m;
}
/// x y^T.
template <typename T, int D>
GRAUPEL_HD Mat<T, D> outer(const Vec<T, D>& x, const Vec<T, D>& y) {
  Mat<T, D> m;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) m.a[r][c] = x.a[r] * y.a[c];
  return m;
}
template <typename T, int D>
GRAUPEL_HD T trace(const Mat<T, D>& x) {
  T s = 0;
  for (int i = 0; i < D; ++i) s += x.a[i][i];
  return s;
}
template <typename T>
GRAUPEL_HD T determinant(const Mat<T, 2>& m) {
  return m.a[0][0] * m.a[1][1] - m.a[0][1] * m.a[1][0];
}
template <typename T>
GRAUPEL_HD T determinant(const Mat<T, 3>& m) {
  return m.a[0][0] * (m.a[1][1] * m.a[2][2] - m.a[1][2] * m.a[2][1]) -
         m.a[0][1] * (m.a[1][0] * m.a[2][2] - m.a[1][2] * m.a[2][0]) +
         m.a[0][2] * (m.a[1][0] * m.a[2][1] - m.a[1][1] * m.a[2][0]);
}
/// Sum of the products of all entries, x : y.
template <typename T, int D>
GRAUPEL_HD T double_dot(const Mat<T, D>& x, const Mat<T, D>& y) {
  T s = 0;
  for (int r = 0; r < D; ++r)
    for (int c = 0; c < D; ++c) s += x.a[r][c] * y.a[r][c];
  return s;
}

using Mat3f = Mat<float, 3>;
using Mat3d = Mat<double, 3>;

/// Rotation by `angle` [rad] about the unit vector `axis` (Rodrigues' formula).
template <typename T>
GRAUPEL_HD Mat<T, 3> rotation_about(const Vec<T, 3>& axis, T angle) {
  const T c = std::cos(angle), s = std::sin(angle);
  Mat<T, 3> m = outer(axis, axis) * (T(1) - c);
  for (int i = 0; i < 3; ++i) m(i, i) += c;
  m(0, 1) -= s * axis[2];
  m(0, 2) += s * axis[1];
  m(1, 0) += s * axis[2];
  m(1, 2) -= s * axis[0];
  m(2, 0) -= s * axis[1];
  m(2, 1) += s * axis[0];
  return m;
}

}  // namespace graupel
