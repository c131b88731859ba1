// Quadratic and cubic B-spline weights, the kernels of all transfers (Steffen, Kirby and Berzins 2008; Stomakhin et al.
// 2013).
//   quadratic: N(u) = 3/4 - u^2 for |u| < 1/2, (3/2 - |u|)^2 / 2 for 1/2 <= |u| < 3/2, else 0
//   cubic:     N(u) = 2/3 - u^2 + |u|^3 / 2 for |u| < 1, (2 - |u|)^3 / 6 for 1 <= |u| < 2, else 0
// Their second moments are D = dx^2/4 I and dx^2/3 I, which makes APIC's inertia tensor a constant (Jiang et al. 2015).
#pragma once

#include "core/math/vec.h"
#include "core/scene/transfer_config.h"

namespace graupel::mpm {

template <Spline S>
struct BSpline;
template <>
struct BSpline<Spline::quadratic> {
  static constexpr int width = 3;              ///< nodes that a particle touches along one axis
  static constexpr double half_support = 1.5;  ///< half the support [cells]
  static constexpr double base_shift = 0.5;    ///< the lowest node of the stencil is floor(x/dx - base_shift)
  static constexpr double inverse_moment = 4;  ///< of the second moment [1/dx^2]
};
template <>
struct BSpline<Spline::cubic> {
  static constexpr int width = 4;
  static constexpr double half_support = 2;
  static constexpr double base_shift = 1;
  static constexpr double inverse_moment = 3;
};

/// The same for a spline that is known at run time only.
GRAUPEL_HD inline double base_shift(Spline spline) {
  return spline == Spline::cubic ? BSpline<Spline::cubic>::base_shift : BSpline<Spline::quadratic>::base_shift;
}
GRAUPEL_HD inline double inverse_moment(Spline spline) {
  return spline == Spline::cubic ? BSpline<Spline::cubic>::inverse_moment : BSpline<Spline::quadratic>::inverse_moment;
}

/// Nodes that a particle touches along one axis.
template <Spline S = Spline::quadratic>
inline constexpr int stencil_width = BSpline<S>::width;

/// Weights of nodes base, base + 1, ... for a particle `fx` cells above node `base`, fx in [1/2, 3/2) (quadratic) or
/// [1, 2) (cubic).
template <typename T, Spline S = Spline::quadratic>
struct AxisWeights {
  T w[stencil_width<S>];
};

template <Spline S = Spline::quadratic, typename T>
GRAUPEL_HD inline AxisWeights<T, S> bspline_weights(T fx) {
  if constexpr (S == Spline::cubic) {
    const T t = fx - T(1), s = T(1) - t;  // distances from the two middle nodes
    return {{s * s * s * T(1.0 / 6), T(2.0 / 3) - t * t * (T(1) - T(0.5) * t), T(2.0 / 3) - s * s * (T(1) - T(0.5) * s),
             t * t * t * T(1.0 / 6)}};
  } else {
    const T low = T(1.5) - fx, mid = fx - T(1), high = fx - T(0.5);
    return {{T(0.5) * low * low, T(0.75) - mid * mid, T(0.5) * high * high}};
  }
}

/// N(u) for a distance of u cells; used where a node looks for its particles.
template <Spline S = Spline::quadratic, typename T>
GRAUPEL_HD inline T bspline(T u) {
  const T a = std::abs(u);
  if constexpr (S == Spline::cubic) {
    if (a < T(1)) return T(2.0 / 3) - a * a * (T(1) - T(0.5) * a);
    const T rest = a < T(2) ? T(2) - a : T(0);
    return rest * rest * rest * T(1.0 / 6);
  } else {
    if (a < T(0.5)) return T(0.75) - a * a;
    if (a < T(1.5)) return T(0.5) * (T(1.5) - a) * (T(1.5) - a);
    return T(0);
  }
}

}  // namespace graupel::mpm
