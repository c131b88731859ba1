// Points and weights of a reduced-order model's clusters from training snapshots (train/grid_sums.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "train/grid_sums.h"
#include "train/nsf_config.h"
#include "train/snapshot_set.h"

namespace graupel::train {

struct FittedQuadrature {
  std::vector<int32_t> points;  ///< a particle of each cluster
  std::vector<float> weights;   ///< over the masses of the clusters; together they keep the body's; empty: all 1
  /// As clusters have them without a fit, and these; in snapshots that they were not fitted to.
  QuadratureError before, after;
  double seconds = 0, read_seconds = 0;
};

/// As `config` wants them, from snapshots that are spread over runs and frames. Cubic splines and planes are fitted
/// with quadratic splines in space, which are near to theirs.
FittedQuadrature fit_quadrature(const SnapshotSet& set, const rom::Clusters& clusters, const NsfConfig& config);

}  // namespace graupel::train
