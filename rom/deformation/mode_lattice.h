// The lattice that modes of a deformation live on: quadratic B-splines of nodes around the reference body, the kernel
// of MPM's transfers, so that a mode has a continuous gradient at every material point.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/math/mat.h"
#include "core/math/vec.h"
#include "mpm/bspline.h"

namespace graupel::rom {

/// Nodes that a point depends on.
inline constexpr int mode_stencil = 27;

struct ModeLattice {
  Vec3d low;           ///< node (0, 0, 0) [m]
  double spacing = 1;  ///< [m]
  Vec<int, 3> count;   ///< nodes along each axis, at least 3

  int64_t nodes() const { return static_cast<int64_t>(count[0]) * count[1] * count[2]; }
  int64_t node(int i, int j, int k) const { return (static_cast<int64_t>(i) * count[1] + j) * count[2] + k; }
  /// Around points [n, 3] [m] with a cell to spare, where points outside of the body may still ask. Nodes lie at whole
  /// spacings from `origin` [m]: with that of MPM's grid and its spacing, the lattice has the grid's own splines.
  static ModeLattice around(const std::vector<float>& points, double spacing, const Vec3d& origin);
};

/// X of point p of points [n, 3] [m].
inline Vec3d point_of(const std::vector<float>& points, int64_t p) {
  const float* const x = points.data() + 3 * p;
  return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
}

/// First of the three nodes along an axis that a point depends on, u [spacings] from the lattice's low end.
inline int mode_base(const ModeLattice& lattice, int axis, double u) {
  return static_cast<int>(std::fmin(std::fmax(std::floor(u - 0.5), 0.0), lattice.count[axis] - 3.0));  // NaN: 0
}

/// N_i(X) and dN_i/dX [1/m] of the nodes i that X depends on; beyond the lattice its last splines go on.
struct ModeStencil {
  int64_t node[mode_stencil];
  double weight[mode_stencil];
  Vec3d gradient[mode_stencil];

  ModeStencil(const ModeLattice& lattice, const Vec3d& point) {
    int base[3];
    double w[3][3], slope[3][3];
    for (int d = 0; d < 3; ++d) {
      const double u = (point[d] - lattice.low[d]) / lattice.spacing;
      base[d] = mode_base(lattice, d, u);
      const double fx = u - base[d];
      const mpm::AxisWeights<double> axis = mpm::bspline_weights(fx);
      std::copy_n(axis.w, 3, w[d]);
      slope[d][0] = (fx - 1.5) / lattice.spacing;
      slope[d][1] = (2 - 2 * fx) / lattice.spacing;
      slope[d][2] = (fx - 0.5) / lattice.spacing;
    }
    for (int i = 0, n = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k, ++n) {
          node[n] = lattice.node(base[0] + i, base[1] + j, base[2] + k);
          weight[n] = w[0][i] * w[1][j] * w[2][k];
          gradient[n] = {slope[0][i] * w[1][j] * w[2][k], w[0][i] * slope[1][j] * w[2][k],
                         w[0][i] * w[1][j] * slope[2][k]};
        }
  }
};

inline ModeLattice ModeLattice::around(const std::vector<float>& points, double spacing, const Vec3d& origin) {
  ModeLattice lattice;
  lattice.spacing = spacing;
  for (int d = 0; d < 3; ++d) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = static_cast<std::size_t>(d); i < points.size(); i += 3) {
      low = std::min(low, static_cast<double>(points[i]));
      high = std::max(high, static_cast<double>(points[i]));
    }
    lattice.low[d] = origin[d] + spacing * (std::floor((low - origin[d]) / spacing) - 2);
    lattice.count[d] = static_cast<int>(std::ceil((high - lattice.low[d]) / spacing)) + 3;
  }
  return lattice;
}

}  // namespace graupel::rom
