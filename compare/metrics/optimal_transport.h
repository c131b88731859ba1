// Sinkhorn divergence between two clouds of weighted points: how far mass must be moved, whatever particle carries it.
//   S(a, b) = OT_eps(a, b) - (OT_eps(a, a) + OT_eps(b, b)) / 2, cost |x - y|^2, entropy eps KL(pi | a x b)
// Genevay et al. 2018; the symmetric log-domain iteration with decreasing eps is that of Feydy et al. 2019, section 3.
#pragma once

#include <vector>

#include "compare/metrics/space.h"
#include "core/math/vec.h"

namespace graupel::compare {

/// Points with positive weights of sum 1.
struct WeightedPoints {
  std::vector<Vec3d> position;  ///< [m]
  std::vector<double> weight;
};

/// Cloud of the centres of mass of grid cells: exact in mass and first moment, free of sampling noise.
WeightedPoints bin_points(const std::vector<Vec3d>& position, const std::vector<double>& mass, double cell);

/// Bins both clouds with the smallest cell start * 2^k that leaves at most `limit` points on either side;
/// returns that cell.
double bin_together(const std::vector<Vec3d>& x, const std::vector<double>& x_mass, const std::vector<Vec3d>& y,
                    const std::vector<double>& y_mass, double start, std::size_t limit, WeightedPoints& a,
                    WeightedPoints& b);

/// S(a, b) [m^2] with entropy `eps` [m^2]; at least 0, and exactly 0 for identical clouds. The iteration needs an eps
/// of about the squared distance between neighbouring points or more to converge in the steps it takes.
/// Across periodic walls distances are the shortest ones.
double sinkhorn_divergence(const WeightedPoints& a, const WeightedPoints& b, double eps, const Space& space = {});

}  // namespace graupel::compare
