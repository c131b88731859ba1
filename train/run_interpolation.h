// States between the runs of a sweep with one parameter: at equal times, on the line between two neighbouring runs.
// Fields are linear in the coefficients of their modes, so that these, the latents and the parameter are what is
// interpolated; no snapshot is made. A regression that has such rows follows the sheet between the runs, where every
// rollout of a new parameter goes, and not only the runs themselves.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "train/snapshot_set.h"

namespace graupel::train {

class RunInterpolation {
 public:
  /// Adds nothing.
  RunInterpolation() = default;
  /// `values` of the parameter [runs], no two of them equal; `count` states between each two neighbouring runs.
  RunInterpolation(std::vector<double> values, int count);
  /// Of a sweep. Throws ConfigError where it has not one parameter, or a `count` above 0 and runs of different lengths
  /// or of equal values.
  static RunInterpolation of(const SnapshotSet& set, int64_t count);

  /// The rows, and after them those between neighbours among the runs that are there. `run` of every row: its index
  /// in the values, all rows of a run in the order of time, as many in each.
  Eigen::MatrixXd extend(const Eigen::MatrixXd& rows, const std::vector<int>& run) const;

 private:
  std::vector<double> values_;
  int count_ = 0;
};

}  // namespace graupel::train
