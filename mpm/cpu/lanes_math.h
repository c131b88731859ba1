// Exponential and logarithm of every lane (Cephes' and fdlibm's reductions; errors below 2 units in the last place).
#pragma once

#include <type_traits>

#include "mpm/cpu/lanes.h"

namespace graupel::mpm {
namespace {

/// 2^n of integers that a float or double can hold as an exponent.
template <typename T>
GRAUPEL_LANES Lanes<T> power_of_two(Ints<T> n) {
  if constexpr (sizeof(T) == 4)
    return (Lanes<T>)((n + 127) << 23);
  else
    return (Lanes<T>)((__builtin_convertvector(n, Mask<T>) + 1023) << 52);
}

/// sum_k c[k] x^k.
template <typename T, int n>
GRAUPEL_LANES Lanes<T> polynomial(Lanes<T> x, const T (&c)[n]) {
  Lanes<T> sum = splat(c[n - 1]);
#pragma GCC unroll 16
  for (int k = n - 2; k >= 0; --k) sum = sum * x + c[k];
  return sum;
}

/// e^x; beyond the range of a normal number the nearest one.
template <typename T>
GRAUPEL_LANES Lanes<T> exponential(Lanes<T> x) {
  constexpr bool single = sizeof(T) == 4;
  constexpr T limit = single ? T(87) : T(708);
  x = smaller(larger(x, splat(-limit)), splat(limit));
  const Lanes<T> scaled = x * T(1.4426950408889634074);
  const Ints<T> n = __builtin_convertvector(scaled + (scaled < 0 ? splat(T(-0.5)) : splat(T(0.5))), Ints<T>);
  const Lanes<T> k = __builtin_convertvector(n, Lanes<T>);
  // ln 2 in two parts, of which k times the first is exact.
  const Lanes<T> r = x - k * (single ? T(0.693359375) : T(6.93147180369123816490e-01)) -
                     k * (single ? T(-2.12194440e-4) : T(1.90821492927058770002e-10));
  if constexpr (single) {
    constexpr T c[] = {T(5.0000001201e-1), T(1.6666665459e-1), T(4.1665795894e-2),
                       T(8.3334519073e-3), T(1.3981999507e-3), T(1.9875691500e-4)};
    return (polynomial<T>(r, c) * (r * r) + r + T(1)) * power_of_two<T>(n);
  } else {
    constexpr T c[] = {T(1) / 2,       T(1) / 6,        T(1) / 24,        T(1) / 120,
                       T(1) / 720,     T(1) / 5040,     T(1) / 40320,     T(1) / 362880,
                       T(1) / 3628800, T(1) / 39916800, T(1) / 479001600, T(1) / 6227020800};
    return (polynomial<T>(r, c) * (r * r) + r + T(1)) * power_of_two<T>(n);
  }
}

/// ln x of positive normal numbers: x = 2^k m, sqrt(1/2) <= m < sqrt(2); ln m = 2 artanh((m - 1) / (m + 1)).
template <typename T>
GRAUPEL_LANES Lanes<T> logarithm(Lanes<T> x) {
  constexpr bool single = sizeof(T) == 4;
  constexpr int shift = single ? 23 : 52;
  using Bits = Mask<T>;
  // Added to the bits, so that the exponent turns over at sqrt(2) instead of 2.
  constexpr auto turn_over =
      static_cast<std::conditional_t<single, int32_t, int64_t>>(single ? 0x004afb0d : 0x00095f619980c433);
  const Bits turned = (Bits)x + turn_over;
  const Bits exponent = (turned >> shift) - (single ? 127 : 1023);
  const Lanes<T> m = (Lanes<T>)((Bits)x - (exponent << shift));
  const Lanes<T> k = __builtin_convertvector(__builtin_convertvector(exponent, Ints<T>), Lanes<T>);
  const Lanes<T> f = m - T(1), s = f / (f + T(2)), z = s * s;
  Lanes<T> tail;
  if constexpr (single) {
    constexpr T c[] = {T(0.66666662693), T(0.40000972152), T(0.28498786688), T(0.24279078841)};
    tail = z * polynomial<T>(z, c);
  } else {
    constexpr T c[] = {6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01,
                       2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01,
                       1.479819860511658591e-01};
    tail = z * polynomial<T>(z, c);
  }
  const Lanes<T> half = T(0.5) * f * f;
  return k * (single ? T(0.693359375) : T(6.93147180369123816490e-01)) -
         ((half - (s * (half + tail) + k * (single ? T(-2.12194440e-4) : T(1.90821492927058770002e-10)))) - f);
}

}  // namespace
}  // namespace graupel::mpm
