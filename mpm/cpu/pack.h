// Pack<T>: the numbers of several particles, one a lane, as a scalar that the constitutive laws are written over
// (mpm/materials/scalar.h).
#pragma once

#include "mpm/cpu/lanes_math.h"
#include "mpm/cpu/lanes_matrix.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {
namespace {

/// The lanes for which a comparison holds.
template <typename T>
struct PackMask {
  Mask<T> m;

  PackMask() = default;
  GRAUPEL_LANES_MEMBER PackMask(Mask<T> mask) : m(mask) {}
  GRAUPEL_LANES_MEMBER explicit PackMask(bool all) : m(all ? ~Mask<T>{} : Mask<T>{}) {}
  GRAUPEL_LANES_MEMBER friend PackMask operator|(PackMask a, PackMask b) { return a.m | b.m; }
  GRAUPEL_LANES_MEMBER friend PackMask operator&(PackMask a, PackMask b) { return a.m & b.m; }
  GRAUPEL_LANES_MEMBER friend PackMask operator!(PackMask a) { return ~a.m; }
};

template <typename T>
struct Pack {
  Lanes<T> v;

  Pack() = default;
  GRAUPEL_LANES_MEMBER Pack(Lanes<T> lanes) : v(lanes) {}
  /// The same number in all lanes (x - 0 is x, which x + 0 is not for -0).
  GRAUPEL_LANES_MEMBER explicit Pack(T number) : v(number - Lanes<T>{}) {}

  GRAUPEL_LANES_MEMBER Pack& operator+=(Pack b) { return v += b.v, *this; }
  GRAUPEL_LANES_MEMBER Pack& operator-=(Pack b) { return v -= b.v, *this; }
  GRAUPEL_LANES_MEMBER Pack& operator*=(Pack b) { return v *= b.v, *this; }
  GRAUPEL_LANES_MEMBER friend Pack operator-(Pack a) { return -a.v; }
};

#define GRAUPEL_PACK_OPERATOR(op)                                 \
  template <typename T>                                           \
  GRAUPEL_LANES Pack<T> operator op(Pack<T> a, Pack<T> b) {       \
    return a.v op b.v;                                            \
  }                                                               \
  template <typename T>                                           \
  GRAUPEL_LANES Pack<T> operator op(Pack<T> a, Real<Pack<T>> b) { \
    return a.v op b;                                              \
  }                                                               \
  template <typename T>                                           \
  GRAUPEL_LANES Pack<T> operator op(Real<Pack<T>> a, Pack<T> b) { \
    return a op b.v;                                              \
  }
#define GRAUPEL_PACK_COMPARISON(op)                                   \
  template <typename T>                                               \
  GRAUPEL_LANES PackMask<T> operator op(Pack<T> a, Pack<T> b) {       \
    return a.v op b.v;                                                \
  }                                                                   \
  template <typename T>                                               \
  GRAUPEL_LANES PackMask<T> operator op(Pack<T> a, Real<Pack<T>> b) { \
    return a.v op b;                                                  \
  }

}  // namespace

template <typename T>
struct ScalarTypes<Pack<T>> {
  using Real = T;
  using Mask = PackMask<T>;
  using Int = Ints<T>;

  GRAUPEL_LANES_MEMBER static Ints<T> truncated(Pack<T> a) { return __builtin_convertvector(a.v, Ints<T>); }
  GRAUPEL_LANES_MEMBER static Pack<T> from_integer(Ints<T> n) { return __builtin_convertvector(n, Lanes<T>); }
  GRAUPEL_LANES_MEMBER static Ints<T> limited(Ints<T> n, int last) {
    return n < 0 ? Ints<T>{} : n > last ? Ints<T>{} + last : n;
  }
};

namespace {

GRAUPEL_PACK_OPERATOR(+)
GRAUPEL_PACK_OPERATOR(-)
GRAUPEL_PACK_OPERATOR(*)
GRAUPEL_PACK_OPERATOR(/)
GRAUPEL_PACK_COMPARISON(<)
GRAUPEL_PACK_COMPARISON(>)
GRAUPEL_PACK_COMPARISON(<=)
GRAUPEL_PACK_COMPARISON(>=)
GRAUPEL_PACK_COMPARISON(!=)
#undef GRAUPEL_PACK_OPERATOR
#undef GRAUPEL_PACK_COMPARISON

template <typename T>
GRAUPEL_LANES bool any(PackMask<T> mask) {
  return any(mask.m);
}
template <typename T>
GRAUPEL_LANES Pack<T> select(PackMask<T> mask, Pack<T> a, Pack<T> b) {
  return mask.m ? a.v : b.v;
}
template <typename T>
GRAUPEL_LANES Pack<T> smaller(Pack<T> a, Pack<T> b) {
  return smaller(a.v, b.v);
}
template <typename T>
GRAUPEL_LANES Pack<T> larger(Pack<T> a, Pack<T> b) {
  return larger(a.v, b.v);
}
template <typename T>
GRAUPEL_LANES Pack<T> magnitude(Pack<T> a) {
  return magnitude(a.v);
}
template <typename T>
GRAUPEL_LANES Pack<T> square_root(Pack<T> a) {
  return square_root(a.v);
}
template <typename T>
GRAUPEL_LANES Pack<T> exponential(Pack<T> a) {
  return exponential<T>(a.v);
}
template <typename T>
GRAUPEL_LANES Pack<T> logarithm(Pack<T> a) {
  return logarithm<T>(a.v);
}
/// Lanes that are not positive count as the smallest positive numbers.
template <typename T>
GRAUPEL_LANES Pack<T> power(Pack<T> a, Real<Pack<T>> p) {
  return exponential<T>(p * logarithm<T>(larger(a.v, splat(T(1e-30)))));
}

template <typename T>
GRAUPEL_LANES Mat<Pack<T>, 3> packed(const LaneMatrix<T>& a) {
  Mat<Pack<T>, 3> p;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) p(r, c).v = a.m[r][c];
  return p;
}
template <typename T>
GRAUPEL_LANES LaneMatrix<T> unpacked(const Mat<Pack<T>, 3>& p) {
  LaneMatrix<T> a;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) a.m[r][c] = p(r, c).v;
  return a;
}
/// Upper triangle.
template <typename T>
GRAUPEL_LANES LaneSymmetric<T> symmetric_part(const Mat<Pack<T>, 3>& p) {
  LaneSymmetric<T> a;
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) a.s[symmetric_entry(r, c)] = p(r, c).v;
  return a;
}

/// As lanes, whose operands a compiler takes in the order in which they are written: which product of a difference is
/// fused with it, and so the last bit, depends on that.
template <typename T>
GRAUPEL_LANES Pack<T> determinant(const Mat<Pack<T>, 3>& a) {
  return determinant_of<T>(unpacked<T>(a));
}
template <typename T>
GRAUPEL_LANES Mat<Pack<T>, 3> rotation_of(const Mat<Pack<T>, 3>& F) {
  return packed<T>(rotation_of<T>(unpacked<T>(F)));
}

}  // namespace
}  // namespace graupel::mpm
