// Small vectors of D numbers, for host and device.
#pragma once

#include <cmath>

#include "core/parallel/host_device.h"

namespace graupel {

/// D numbers; `v[i]` is component i. Aggregate: `Vec<float, 3>{1, 2, 3}`.
template <typename T, int D>
struct Vec {
  T a[D];

  GRAUPEL_HD T& operator[](int i) { return a[i]; }
  GRAUPEL_HD const T& operator[](int i) const { return a[i]; }

  GRAUPEL_HD static Vec filled(T value) {
    Vec v;
    for (int i = 0; i < D; ++i) v.a[i] = value;
    return v;
  }
  GRAUPEL_HD static Vec zero() { return filled(T(0)); }

  GRAUPEL_HD Vec& operator+=(const Vec& o) {
    for (int i = 0; i < D; ++i) a[i] += o.a[i];
    return *this;
  }
  GRAUPEL_HD Vec& operator-=(const Vec& o) {
    for (int i = 0; i < D; ++i) a[i] -= o.a[i];
    return *this;
  }
  GRAUPEL_HD Vec& operator*=(T s) {
    for (int i = 0; i < D; ++i) a[i] *= s;
    return *this;
  }
  template <typename U>
  GRAUPEL_HD Vec<U, D> cast() const {
    Vec<U, D> v;
    for (int i = 0; i < D; ++i) v.a[i] = static_cast<U>(a[i]);
    return v;
  }
  GRAUPEL_HD friend bool operator==(const Vec& x, const Vec& y) {
    for (int i = 0; i < D; ++i)
      if (!(x.a[i] == y.a[i])) return false;
    return true;
  }
};

template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator+(Vec<T, D> x, const Vec<T, D>& y) {
  return x += y;
}
template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator-(Vec<T, D> x, const Vec<T, D>& y) {
  return x -= y;
}
template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator-(Vec<T, D> x) {
  return x *= T(-1);
}
template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator*(Vec<T, D> x, T s) {
  return x *= s;
}
template <typename T, int D>
GRAUPEL_HD Vec<T, D> operator*(T s, Vec<T, D> x) {
  return x *= s;
}
template <typename T, int D>
GRAUPEL_HD T dot(const Vec<T, D>& x, const Vec<T, D>& y) {
  T s = 0;
  for (int i = 0; i < D; ++i) s += x.a[i] * y.a[i];
  return s;
}
template <typename T, int D>
GRAUPEL_HD T norm2(const Vec<T, D>& x) {
  return dot(x, x);
}
template <typename T, int D>
GRAUPEL_HD T norm(const Vec<T, D>& x) {
  return std::sqrt(dot(x, x));
}
/// x / |x|, or zero for the zero vector.
template <typename T, int D>
GRAUPEL_HD Vec<T, D> normalized(const Vec<T, D>& x) {
  const T n = norm(x);
  return n > T(0) ? x * (T(1) / n) : Vec<T, D>::zero();
}
template <typename T>
GRAUPEL_HD Vec<T, 3> cross(const Vec<T, 3>& x, const Vec<T, 3>& y) {
  return {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
}

using Vec3f = Vec<float, 3>;
using Vec3d = Vec<double, 3>;
using Vec3i = Vec<int, 3>;

}  // namespace graupel
