// Quadratic B-spline weights, the kernel of all transfers (Steffen, Kirby and Berzins 2008; Stomakhin et al. 2013).
//   N(u) = 3/4 - u^2 for |u| < 1/2, (3/2 - |u|)^2 / 2 for 1/2 <= |u| < 3/2, else 0
// Their second moment is D = dx^2/4 I, which makes APIC's inertia tensor a constant (Jiang et al. 2015).
#pragma once

#include "core/vec.h"

namespace graupel::mpm {

/// Nodes that a particle touches along one axis.
inline constexpr int stencil_width = 3;

/// Weights of nodes base, base + 1, base + 2 for a particle `fx` cells above node `base`, fx in [1/2, 3/2).
template <typename T>
struct AxisWeights {
  T w[stencil_width];
};

template <typename T>
GRAUPEL_HD inline AxisWeights<T> bspline_weights(T fx) {
  const T low = T(1.5) - fx, mid = fx - T(1), high = fx - T(0.5);
  return {{T(0.5) * low * low, T(0.75) - mid * mid, T(0.5) * high * high}};
}

/// N(u) for a distance of u cells; used where a node looks for its particles.
template <typename T>
GRAUPEL_HD inline T bspline(T u) {
  const T a = std::abs(u);
  if (a < T(0.5)) return T(0.75) - a * a;
  if (a < T(1.5)) return T(0.5) * (T(1.5) - a) * (T(1.5) - a);
  return T(0);
}

/// Lowest node of the stencil: floor(x/dx - 1/2), for a position `local` >= 1/2 in cells from the grid's origin.
template <typename T, int D>
GRAUPEL_HD inline Vec<int, D> base_node(const Vec<T, D>& local) {
  Vec<int, D> base;
  for (int d = 0; d < D; ++d) base[d] = static_cast<int>(local[d] - T(0.5));
  return base;
}

}  // namespace graupel::mpm
