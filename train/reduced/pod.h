// Proper orthogonal decomposition by the method of snapshots: the modes that hold the most of a set of snapshots, from
// the eigenvectors of their Gram matrix (Sirovich 1987). Products of snapshots are summed in f64 over pieces of
// columns.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "train/reduced/snapshot_blocks.h"

namespace graupel::train {

struct Pod {
  std::vector<float> mean;       ///< of the snapshots [width]
  std::vector<float> basis;      ///< [width, modes]; mode k has the root mean square of its coefficients as its length
  Eigen::MatrixXd coefficients;  ///< [snapshots, modes], with mean square 1 in every column
  Eigen::VectorXd singular;      ///< all singular values, falling
  int modes() const { return static_cast<int>(coefficients.cols()); }
  /// Root of the share of the sum of squares that `count` modes leave out.
  double tail(int count) const;
};

enum class PodMean {
  removed,  ///< modes of the differences from the mean
  kept      ///< the mean is zero: for fields that vanish with the velocity
};

/// At most `modes` of them, and none that is rounding only. Two passes over the blocks, the second one backwards: the
/// last block is still in memory then.
Pod pod(SnapshotBlocks& snapshots, int modes, PodMean about = PodMean::removed);

/// Coefficients of other rows (without the mean) in a basis of pod(): least squares, [rows, modes].
Eigen::MatrixXd project(SnapshotBlocks& rows, const Pod& pod, int modes);

}  // namespace graupel::train
