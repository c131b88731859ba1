// Vectors as wide as the registers of the instruction set that a file is compiled for, on GCC's vector types. Only
// kernels.cpp, which is compiled once for each instruction set, may include this folder's lanes_*.h: everything here
// has internal linkage and is inlined, so that no code for one processor can be linked into a program for another.
#pragma once

#include <cstdint>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"          // no vector crosses a call
#pragma GCC diagnostic ignored "-Wuninitialized"  // GCC 12 warns of its own intrinsics
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#define GRAUPEL_LANES [[gnu::always_inline]] static inline
#define GRAUPEL_LANES_MEMBER [[gnu::always_inline]] inline

namespace graupel::mpm {
namespace {

#if defined(__AVX512F__)
constexpr int register_bytes = 64;
#elif defined(__AVX2__)
constexpr int register_bytes = 32;
#else
constexpr int register_bytes = 16;
#endif

/// Lanes of a vector: at least the four channels of a node.
template <typename T>
constexpr int width = register_bytes / static_cast<int>(sizeof(T)) < 4 ? 4
                                                                       : register_bytes / static_cast<int>(sizeof(T));

template <typename T>
struct VectorTypes;
template <>
struct VectorTypes<float> {
  typedef float Lanes __attribute__((vector_size(width<float> * 4)));
  typedef int32_t Mask __attribute__((vector_size(width<float> * 4)));
  typedef int32_t Ints __attribute__((vector_size(width<float> * 4)));
  typedef float Node __attribute__((vector_size(16)));
};
template <>
struct VectorTypes<double> {
  typedef double Lanes __attribute__((vector_size(width<double> * 8)));
  typedef int64_t Mask __attribute__((vector_size(width<double> * 8)));
  typedef int32_t Ints __attribute__((vector_size(width<double> * 4)));
  typedef double Node __attribute__((vector_size(32)));
};
/// width<T> numbers; the result of comparing them (0 or -1); as many integers; the four channels of a node.
template <typename T>
using Lanes = typename VectorTypes<T>::Lanes;
template <typename T>
using Mask = typename VectorTypes<T>::Mask;
template <typename T>
using Ints = typename VectorTypes<T>::Ints;
template <typename T>
using Node = typename VectorTypes<T>::Node;

template <typename V, typename T>
GRAUPEL_LANES V load_as(const T* from) {
  V v;
  __builtin_memcpy(&v, from, sizeof(V));
  return v;
}
template <typename T>
GRAUPEL_LANES Lanes<T> load(const T* from) {
  return load_as<Lanes<T>>(from);
}
template <typename V, typename T>
GRAUPEL_LANES void store(T* to, const V& v) {
  __builtin_memcpy(to, &v, sizeof(V));
}
template <typename T>
GRAUPEL_LANES Lanes<T> splat(T value) {
  return Lanes<T>{} + value;
}

template <typename V>
GRAUPEL_LANES V smaller(V a, V b) {
  return a < b ? a : b;
}
template <typename V>
GRAUPEL_LANES V larger(V a, V b) {
  return a > b ? a : b;
}
template <typename V>
GRAUPEL_LANES V magnitude(V a) {
  return a < 0 ? -a : a;
}

/// Whether any lane of a mask is set.
template <typename M>
GRAUPEL_LANES bool any(M mask) {
#if defined(__AVX512F__)
  if constexpr (sizeof(M) == 64) return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
#endif
#if defined(__AVX2__)
  if constexpr (sizeof(M) == 32) return _mm256_movemask_epi8((__m256i)mask) != 0;
#endif
#if defined(__SSE2__)
  if constexpr (sizeof(M) == 16) return _mm_movemask_epi8((__m128i)mask) != 0;
#endif
  int64_t words[sizeof(M) / 8], set = 0;
  __builtin_memcpy(words, &mask, sizeof(M));
  for (const int64_t word : words) set |= word;
  return set != 0;
}

GRAUPEL_LANES Lanes<float> square_root(Lanes<float> x) {
#if defined(__AVX512F__)
  return (Lanes<float>)_mm512_sqrt_ps((__m512)x);
#elif defined(__AVX2__)
  return (Lanes<float>)_mm256_sqrt_ps((__m256)x);
#else
  for (int l = 0; l < width<float>; ++l) x[l] = __builtin_sqrtf(x[l]);
  return x;
#endif
}
GRAUPEL_LANES Lanes<double> square_root(Lanes<double> x) {
#if defined(__AVX512F__)
  return (Lanes<double>)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX2__)
  return (Lanes<double>)_mm256_sqrt_pd((__m256d)x);
#else
  for (int l = 0; l < width<double>; ++l) x[l] = __builtin_sqrt(x[l]);
  return x;
#endif
}

template <typename T>
GRAUPEL_LANES T largest_of(Lanes<T> x) {
  T largest = x[0];
  for (int l = 1; l < width<T>; ++l) largest = x[l] > largest ? x[l] : largest;
  return largest;
}

}  // namespace
}  // namespace graupel::mpm
