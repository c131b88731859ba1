// One stencil row of an arena, 4 nodes x 4 channels, as one value: GCC's vector types on the host, where they compile
// to full-width registers (the same loops over an array took three times as long), a plain array elsewhere.
#pragma once

#include "core/parallel/host_device.h"

namespace graupel::mpm {

inline constexpr int row_lanes = 16;

#if defined(__GNUC__) && !defined(__CUDA_ARCH__)
typedef float FloatLanes __attribute__((vector_size(row_lanes * sizeof(float))));
typedef double DoubleLanes __attribute__((vector_size(row_lanes * sizeof(double))));
template <typename T>
struct LanesOf;
template <>
struct LanesOf<float> {
  using Type = FloatLanes;
};
template <>
struct LanesOf<double> {
  using Type = DoubleLanes;
};
#else
template <typename T>
struct ArrayLanes {
  T a[row_lanes];
  GRAUPEL_HD T& operator[](int i) { return a[i]; }
  GRAUPEL_HD const T& operator[](int i) const { return a[i]; }
  GRAUPEL_HD friend ArrayLanes operator+(ArrayLanes x, const ArrayLanes& y) {
    for (int i = 0; i < row_lanes; ++i) x.a[i] += y.a[i];
    return x;
  }
  GRAUPEL_HD friend ArrayLanes operator*(ArrayLanes x, const ArrayLanes& y) {
    for (int i = 0; i < row_lanes; ++i) x.a[i] *= y.a[i];
    return x;
  }
  GRAUPEL_HD friend ArrayLanes operator*(T s, ArrayLanes x) {
    for (int i = 0; i < row_lanes; ++i) x.a[i] *= s;
    return x;
  }
};
template <typename T>
struct LanesOf {
  using Type = ArrayLanes<T>;
};
#endif

template <typename T>
struct RowLanes {
  typename LanesOf<T>::Type v;

  /// The four channels a, b, c, d at each of the four nodes.
  GRAUPEL_HD static RowLanes repeated(T a, T b, T c, T d) {
    const typename LanesOf<T>::Type lanes = {a, b, c, d, a, b, c, d, a, b, c, d, a, b, c, d};
    return {lanes};
  }
  /// a at every channel of node 0, b of node 1, c of node 2, d of node 3.
  GRAUPEL_HD static RowLanes stairs(T a, T b, T c, T d = T(0)) {
    const typename LanesOf<T>::Type lanes = {a, a, a, a, b, b, b, b, c, c, c, c, d, d, d, d};
    return {lanes};
  }
  GRAUPEL_HD friend RowLanes operator+(const RowLanes& x, const RowLanes& y) { return {x.v + y.v}; }
  GRAUPEL_HD friend RowLanes operator*(const RowLanes& x, const RowLanes& y) { return {x.v * y.v}; }
  GRAUPEL_HD friend RowLanes operator*(T s, const RowLanes& x) { return {s * x.v}; }
};

/// Adds a row to 16 numbers in memory.
template <typename T>
GRAUPEL_HD inline void add_to(T* memory, const RowLanes<T>& row) {
#if defined(__GNUC__) && !defined(__CUDA_ARCH__)
  typename LanesOf<T>::Type lanes;
  __builtin_memcpy(&lanes, memory, sizeof(lanes));
  lanes = lanes + row.v;
  __builtin_memcpy(memory, &lanes, sizeof(lanes));
#else
  for (int i = 0; i < row_lanes; ++i) memory[i] += row.v[i];
#endif
}

}  // namespace graupel::mpm
