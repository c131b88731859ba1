// The nodes that a particle touches: the lowest one and the particle's distance from it, from which follow the weights
// (mpm/bspline.h). Written over the scalar of mpm/materials/scalar.h.
#pragma once

#include "mpm/bspline.h"
#include "mpm/materials/scalar.h"

namespace graupel::mpm {

/// A stencil along one axis.
template <typename S>
struct AxisStencil {
  IntOf<S> base;  ///< lowest node
  S fx;           ///< from there to the particle [cells], in [1/2, 3/2) or, cubic, [1, 2)
};

/// floor(local - shift), for a position `local` >= shift in cells from node 0.
template <Spline spline = Spline::quadratic, typename S>
GRAUPEL_HD inline IntOf<S> lowest_node(const S& local) {
  return ScalarTypes<S>::truncated(local - Real<S>(BSpline<spline>::base_shift));
}

template <Spline spline = Spline::quadratic, typename S>
GRAUPEL_HD inline AxisStencil<S> axis_stencil(const S& local) {
  const IntOf<S> base = lowest_node<spline>(local);
  return {base, local - ScalarTypes<S>::from_integer(base)};
}
/// The same with the base counted from node `first` and kept within 0..last, so that rounding at a block's face cannot
/// leave the block's arena.
template <Spline spline = Spline::quadratic, typename S>
GRAUPEL_HD inline AxisStencil<S> axis_stencil(const S& local, const IntOf<S>& first, int last) {
  const IntOf<S> base = ScalarTypes<S>::limited(lowest_node<spline>(local) - first, last);
  return {base, local - ScalarTypes<S>::from_integer(first + base)};
}

/// A stencil along all axes, of a particle that is one number an axis.
template <typename T, int D>
struct Stencil {
  Vec<int, D> base;
  Vec<T, D> fx;
};

template <Spline spline = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline Stencil<T, D> stencil_at(const Vec<T, D>& local) {
  Stencil<T, D> s;
  for (int d = 0; d < D; ++d) {
    const AxisStencil<T> axis = axis_stencil<spline>(local[d]);
    s.base[d] = axis.base;
    s.fx[d] = axis.fx;
  }
  return s;
}
template <Spline spline = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline Stencil<T, D> stencil_at(const Vec<T, D>& local, const Vec<int, D>& first, int last) {
  Stencil<T, D> s;
  for (int d = 0; d < D; ++d) {
    const AxisStencil<T> axis = axis_stencil<spline>(local[d], first[d], last);
    s.base[d] = axis.base;
    s.fx[d] = axis.fx;
  }
  return s;
}

template <Spline spline = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline Vec<int, D> base_node(const Vec<T, D>& local) {
  return stencil_at<spline>(local).base;
}

}  // namespace graupel::mpm
