// Moves of numbers between lanes: a node's four channels to many nodes, and components of particles to particles.
#pragma once

#include "mpm/cpu/lanes.h"

namespace graupel::mpm {
namespace {

/// a0 b0 a1 b1 ... of the lower halves.
template <typename V>
GRAUPEL_LANES V zip_low(V a, V b) {
  if constexpr (sizeof(V) / sizeof(a[0]) == 4)
    return __builtin_shufflevector(a, b, 0, 4, 1, 5);
  else if constexpr (sizeof(V) / sizeof(a[0]) == 8)
    return __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11);
  else
    return __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
}
/// The same of the upper halves.
template <typename V>
GRAUPEL_LANES V zip_high(V a, V b) {
  if constexpr (sizeof(V) / sizeof(a[0]) == 4)
    return __builtin_shufflevector(a, b, 2, 6, 3, 7);
  else if constexpr (sizeof(V) / sizeof(a[0]) == 8)
    return __builtin_shufflevector(a, b, 4, 12, 5, 13, 6, 14, 7, 15);
  else
    return __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
}
/// a0 a2 ... b0 b2 ...
template <typename V>
GRAUPEL_LANES V even_lanes(V a, V b) {
  if constexpr (sizeof(V) / sizeof(a[0]) == 4)
    return __builtin_shufflevector(a, b, 0, 2, 4, 6);
  else if constexpr (sizeof(V) / sizeof(a[0]) == 8)
    return __builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14);
  else
    return __builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
}
/// a1 a3 ... b1 b3 ...
template <typename V>
GRAUPEL_LANES V odd_lanes(V a, V b) {
  if constexpr (sizeof(V) / sizeof(a[0]) == 4)
    return __builtin_shufflevector(a, b, 1, 3, 5, 7);
  else if constexpr (sizeof(V) / sizeof(a[0]) == 8)
    return __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15);
  else
    return __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
}

// GCC 12 moves parts of wide vectors through memory where it is given shuffles of unequal lengths, hence the
// intrinsics.
/// The four channels of a node, repeated.
template <typename T>
GRAUPEL_LANES Lanes<T> repeated(Node<T> v) {
#if defined(__AVX512F__)
  if constexpr (sizeof(T) == 4)
    return (Lanes<T>)_mm512_broadcast_f32x4((__m128)v);
  else
    return (Lanes<T>)_mm512_broadcast_f64x4((__m256d)v);
#elif defined(__AVX2__)
  if constexpr (sizeof(T) == 4)
    return (Lanes<T>)_mm256_set_m128((__m128)v, (__m128)v);
  else
    return v;
#else
  return v;
#endif
}
/// Number k of v at all channels of node k; `part` chooses which nodes.
template <typename T, int part>
GRAUPEL_LANES Lanes<T> stairs(Node<T> v) {
  [[maybe_unused]] constexpr int n = part * (width<T> / 4);
#if defined(__AVX512F__)
  if constexpr (sizeof(T) == 4)
    return (Lanes<T>)_mm512_permutevar_ps(_mm512_broadcast_f32x4((__m128)v),
                                          _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0));
  else
    return (Lanes<T>)_mm512_permutexvar_pd(_mm512_set_epi64(n + 1, n + 1, n + 1, n + 1, n, n, n, n),
                                           _mm512_castpd256_pd512((__m256d)v));
#elif defined(__AVX2__)
  if constexpr (sizeof(T) == 4)
    return (Lanes<T>)_mm256_permutevar_ps(_mm256_set_m128((__m128)v, (__m128)v),
                                          _mm256_set_epi32(n + 1, n + 1, n + 1, n + 1, n, n, n, n));
  else
    return __builtin_shufflevector(v, v, n, n, n, n);
#else
  return __builtin_shufflevector(v, v, n, n, n, n);
#endif
}
/// The last channel of each node at all its channels.
template <typename V>
GRAUPEL_LANES V last_channel(V v) {
  if constexpr (sizeof(V) / sizeof(v[0]) == 4)
    return __builtin_shufflevector(v, v, 3, 3, 3, 3);
  else if constexpr (sizeof(V) / sizeof(v[0]) == 8)
    return __builtin_shufflevector(v, v, 3, 3, 3, 3, 7, 7, 7, 7);
  else
    return __builtin_shufflevector(v, v, 3, 3, 3, 3, 7, 7, 7, 7, 11, 11, 11, 11, 15, 15, 15, 15);
}
/// Sum over the nodes of a vector.
template <typename T>
GRAUPEL_LANES Node<T> sum_of_nodes(Lanes<T> v) {
#if defined(__AVX512F__)
  if constexpr (sizeof(T) == 4) {
    const __m256 half = _mm512_castps512_ps256((__m512)v) + _mm512_extractf32x8_ps((__m512)v, 1);
    return (Node<T>)(_mm256_castps256_ps128(half) + _mm256_extractf128_ps(half, 1));
  } else {
    return (Node<T>)(_mm512_castpd512_pd256((__m512d)v) + _mm512_extractf64x4_pd((__m512d)v, 1));
  }
#elif defined(__AVX2__)
  if constexpr (sizeof(T) == 4)
    return (Node<T>)(_mm256_castps256_ps128((__m256)v) + _mm256_extractf128_ps((__m256)v, 1));
  else
    return v;
#else
  return v;
#endif
}

/// Four vectors of components -> in memory, the four components of one lane after another.
template <typename T>
GRAUPEL_LANES void store_by_lane(T* to, Lanes<T> a, Lanes<T> b, Lanes<T> c, Lanes<T> d) {
  const Lanes<T> ac = zip_low(a, c), bd = zip_low(b, d), ac_high = zip_high(a, c), bd_high = zip_high(b, d);
  store(to, zip_low(ac, bd));
  store(to + width<T>, zip_high(ac, bd));
  store(to + 2 * width<T>, zip_low(ac_high, bd_high));
  store(to + 3 * width<T>, zip_high(ac_high, bd_high));
}
/// The first three components back from there.
template <typename T>
GRAUPEL_LANES void load_by_lane(const T* from, Lanes<T>& a, Lanes<T>& b, Lanes<T>& c) {
  const Lanes<T> r0 = load(from), r1 = load(from + width<T>), r2 = load(from + 2 * width<T>),
                 r3 = load(from + 3 * width<T>);
  const Lanes<T> ac0 = even_lanes(r0, r1), ac1 = even_lanes(r2, r3);
  a = even_lanes(ac0, ac1);
  c = odd_lanes(ac0, ac1);
  b = even_lanes(odd_lanes(r0, r1), odd_lanes(r2, r3));
}

}  // namespace
}  // namespace graupel::mpm
