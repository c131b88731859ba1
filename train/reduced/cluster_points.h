// Integration points of a reduced-order model's clusters: the particles that match the sums at grid nodes of training
// snapshots best (train/reduced/cubature_rows.h).
#pragma once

#include <vector>

#include "train/reduced/cubature_rows.h"
#include "train/reduced/snapshot_set.h"

namespace graupel::train {

struct ClusterPoints {
  std::vector<int32_t> points;  ///< a particle of each cluster
  /// Of random points, and of these; in snapshots that they were not fitted to.
  QuadratureError before, after;
  double seconds = 0, read_seconds = 0;
};

/// From so many `snapshots` that are spread over runs and frames. Cubic splines and planes are fitted
/// with quadratic splines in space, which are near to theirs.
ClusterPoints match_cluster_points(const SnapshotSet& set, const rom::Clusters& clusters, int64_t snapshots);

}  // namespace graupel::train
