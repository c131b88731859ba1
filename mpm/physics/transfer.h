// APIC transfers of one particle (Jiang et al. 2015) with the MLS-MPM force (Hu et al. 2018):
//   p_i += w_ip (m v + A (x_i - x_p)),   A = m C - dt V0 (k / dx^2) tau
//   v_p = sum_i w_ip v_i,                C = (k / dx^2) sum_i w_ip v_i (x_i - x_p)^T
// with k = 4 for the quadratic spline and 3 for the cubic one (the inverse of its second moment). Arena rows are summed
// 4 nodes x 4 channels at a time, so that a compiler uses its widest registers.
#pragma once

#include <cmath>
#include <type_traits>

#include "core/scene/transfer_config.h"
#include "mpm/grid/grid.h"
#include "mpm/physics/row_lanes.h"
#include "mpm/physics/stencil.h"

namespace graupel::mpm {

/// A dx = (m C - dt V0 (k / dx^2) tau) dx: change of a particle's momentum over one cell [kg m/s].
template <Spline spline = Spline::quadratic, typename S, int D>
GRAUPEL_HD inline Mat<S, D> affine_momentum(const S& mass, const S& volume, Real<S> dt, Real<S> dx, Real<S> inverse_dx,
                                            const Mat<S, D>& C, const Mat<S, D>& tau) {
  constexpr auto k = Real<S>(BSpline<spline>::inverse_moment);
  if constexpr (std::is_same_v<S, Real<S>>) {
    return (mass * dx) * C + (-dt * volume * k * inverse_dx) * tau;
  } else {  // first what all particles share; rounded in the order in which it stands
    Mat<S, D> A = (mass * dx) * C;
    return A += ((-k * dt * inverse_dx) * volume) * tau;
  }
}

/// What a transfer scheme carries on of the affine velocity after a substep: C <- a sym(C) + b skew(C). APIC keeps
/// both, RPIC the rotation (Jiang et al. 2015), PIC nothing; damped.
template <typename T>
struct CarriedAffine {
  bool all = true;  ///< APIC without damping: C stays as it is, to the bit
  T symmetric = 1, rotation = 1;

  GRAUPEL_HD Mat<T, 3> operator()(const Mat<T, 3>& C) const {
    if (all) return C;
    const Mat<T, 3> transposed = transpose(C);
    return (T(0.5) * symmetric) * (C + transposed) + (T(0.5) * rotation) * (C - transposed);
  }
};
/// Of a substep of `dt` [s].
template <typename T>
CarriedAffine<T> carried_affine(const TransferConfig& transfer, double dt) {
  const double kept = std::exp(-transfer.damping * dt);
  return {transfer.scheme == TransferScheme::apic && transfer.damping == 0,
          static_cast<T>(transfer.scheme == TransferScheme::apic ? kept : 0),
          static_cast<T>(transfer.scheme == TransferScheme::pic ? 0 : kept)};
}

/// Stencil of a particle in the arena of its owner block `block`; `local` in cells from node 0.
template <Spline S = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline Stencil<T, D> arena_stencil(const Vec<T, D>& local, const Vec<int, D>& block) {
  return stencil_at<S>(local, block_width * block, block_width - 1);
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
GRAUPEL_HD inline void scatter_particle(T* arena, const Stencil<T, D>& stencil, T mass, const Vec<T, D>& momentum,
                                        const Mat<T, D>& affine) {
  AxisWeights<T, S> weights[D];
  for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(stencil.fx[d]);
  const Vec<T, D> at_base = momentum - affine * stencil.fx;
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
    add_to(arena + arena_offset<S>(stencil.base + node), row_w * row);
  }
}

/// Velocity and affine velocity of one particle from an arena of node velocities.
template <Spline S = Spline::quadratic, typename T, int D>
GRAUPEL_HD inline void gather_particle(const T* arena, const Stencil<T, D>& stencil, T inverse_dx, Vec<T, D>& v,
                                       Mat<T, D>& C) {
  AxisWeights<T, S> weights[D];
  for (int d = 0; d < D; ++d) weights[d] = bspline_weights<S>(stencil.fx[d]);
  T sum[row_lanes] = {}, moment[D - 1][row_lanes] = {};
  for (int r = 0; r < stencil_rows<D, S>; ++r) {
    Vec<int, D> node;
    const T w = row_weight(weights, r, node);
    const T* row = arena + arena_offset<S>(stencil.base + node);
    for (int l = 0; l < row_lanes; ++l) {
      const T value = w * row[l];
      sum[l] += value;
      for (int d = 0; d < D - 1; ++d) moment[d][l] += (T(node[d]) - stencil.fx[d]) * value;
    }
  }
  const T scale = T(BSpline<S>::inverse_moment) * inverse_dx;
  for (int c = 0; c < D; ++c) {
    T velocity = 0, last = 0, others[D - 1] = {};
    for (int k = 0; k < stencil_width<S>; ++k) {
      const T w = weights[D - 1].w[k], value = w * sum[channels * k + c];
      velocity += value;
      last += (T(k) - stencil.fx[D - 1]) * value;
      for (int d = 0; d < D - 1; ++d) others[d] += w * moment[d][channels * k + c];
    }
    v[c] = velocity;
    for (int d = 0; d < D - 1; ++d) C(c, d) = scale * others[d];
    C(c, D - 1) = scale * last;
  }
}

}  // namespace graupel::mpm
