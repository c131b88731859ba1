// APIC transfers of one particle (Jiang et al. 2015) with the MLS-MPM force (Hu et al. 2018):
//   p_i += w_ip (m v + A (x_i - x_p)),   A = m C - dt V0 (k / dx^2) tau
//   v_p = sum_i w_ip v_i,                C = (k / dx^2) sum_i w_ip v_i (x_i - x_p)^T
// with k = 4 for the quadratic spline and 3 for the cubic one (the inverse of its second moment). Arena rows are summed
// 4 nodes x 4 channels at a time, so that a compiler uses its widest registers.
#pragma once

#include "mpm/bspline.h"
#include "mpm/grid/grid.h"
#include "mpm/physics/row_lanes.h"

namespace graupel::mpm {

/// Where a particle lies in the arena of its home block.
template <typename T, int D>
struct ArenaPlace {
  Vec<int, D> base;  ///< base node, 0..3 along each axis
  Vec<T, D> fx;      ///< cells above it, [1/2, 3/2) or, cubic, [1, 2)
};

/// `local` in cells from node 0, `block` the home block. The base is kept inside the block, so that rounding at a
/// block's face cannot leave the arena.
template <Spline S = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline ArenaPlace<T, D> arena_place(const Vec<T, D>& local, const Vec<int, D>& block) {
  ArenaPlace<T, D> place;
  const Vec<int, D> base = base_node<S>(local);
  for (int d = 0; d < D; ++d) {
    const int inside = base[d] - block_width * block[d];
    place.base[d] = inside < 0 ? 0 : inside > block_width - 1 ? block_width - 1 : inside;
    place.fx[d] = local[d] - static_cast<T>(block_width * block[d] + place.base[d]);
  }
  return place;
}

/// Product of the weights of stencil row `row` (all axes but the last), with its node coordinates.
template <typename T, Spline S, int D>
GRAUPEL_HD inline T row_weight(const AxisWeights<T, S> (&weights)[D], int row, Vec<int, D>& node) {
  T w = 1;
  node[D - 1] = 0;
  for (int d = D - 2; d >= 0; --d) {
    node[d] = row % stencil_width<S>;
    row /= stencil_width<S>;
    w *= weights[d].w[node[d]];
  }
  return w;
}

template <int D, Spline S = Spline::quadratic>
inline constexpr int stencil_rows = D == 2 ? stencil_width<S> : stencil_width<S>* stencil_width<S>;

/// Adds one particle to an arena. `momentum` is m v [kg m/s], `affine` is A dx [kg m/s].
template <Spline S = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline void scatter_particle(T* arena, const ArenaPlace<T, D>& place, T mass, const Vec<T, D>& momentum,
                                        const Mat<T, D>& affine) {
  AxisWeights<T, S> weights[D];
  for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(place.fx[d]);
  const Vec<T, D> at_base = momentum - affine * place.fx;
  const auto column = [&](int d) {
    return RowLanes<T>::repeated(affine(0, d), affine(1, d), D == 3 ? affine(D - 1, d) : T(0), T(0));
  };
  // The row at the base, and its change from one row to the next along each other axis.
  const T* w = weights[D - 1].w;
  const RowLanes<T> along_row =
      RowLanes<T>::stairs(w[0], w[1], w[2], stencil_width<S> == 4 ? w[stencil_width<S> - 1] : T(0));
  const RowLanes<T> value =
      along_row * (RowLanes<T>::repeated(at_base[0], at_base[1], D == 3 ? at_base[D - 1] : T(0), mass) +
                   RowLanes<T>::stairs(T(0), T(1), T(2), stencil_width<S> == 4 ? T(3) : T(0)) * column(D - 1));
  RowLanes<T> change[D - 1];
  for (int d = 0; d < D - 1; ++d) change[d] = along_row * column(d);
  for (int r = 0; r < stencil_rows<D, S>; ++r) {
    Vec<int, D> node;
    const T row_w = row_weight(weights, r, node);
    RowLanes<T> row = value;
    for (int d = 0; d < D - 1; ++d) row = row + T(node[d]) * change[d];
    add_to(arena + arena_offset<S>(place.base + node), row_w * row);
  }
}

/// Velocity and affine velocity of one particle from an arena of node velocities.
template <Spline S = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline void gather_particle(const T* arena, const ArenaPlace<T, D>& place, T inverse_dx, Vec<T, D>& v,
                                       Mat<T, D>& C) {
  AxisWeights<T, S> weights[D];
  for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(place.fx[d]);
  T sum[row_lanes] = {}, moment[D - 1][row_lanes] = {};
  for (int r = 0; r < stencil_rows<D, S>; ++r) {
    Vec<int, D> node;
    const T w = row_weight(weights, r, node);
    const T* row = arena + arena_offset<S>(place.base + node);
    for (int l = 0; l < row_lanes; ++l) {
      const T value = w * row[l];
      sum[l] += value;
      for (int d = 0; d < D - 1; ++d) moment[d][l] += (T(node[d]) - place.fx[d]) * value;
    }
  }
  const T scale = T(BSpline<S>::inverse_moment) * inverse_dx;
  for (int c = 0; c < D; ++c) {
    T velocity = 0, last = 0, others[D - 1] = {};
    for (int k = 0; k < stencil_width<S>; ++k) {
      const T w = weights[D - 1].w[k], value = w * sum[channels * k + c];
      velocity += value;
      last += (T(k) - place.fx[D - 1]) * value;
      for (int d = 0; d < D - 1; ++d) others[d] += w * moment[d][channels * k + c];
    }
    v[c] = velocity;
    for (int d = 0; d < D - 1; ++d) C(c, d) = scale * others[d];
    C(c, D - 1) = scale * last;
  }
}

}  // namespace graupel::mpm
