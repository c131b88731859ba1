// Proper orthogonal decomposition by the method of snapshots: the modes that hold the most of a set of snapshots, from
// the eigenvectors of their Gram matrix (Sirovich 1987). Products of snapshots are summed in f64 over blocks.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace graupel::train {

/// A snapshot a row.
using SnapshotMatrix = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

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

/// At most `modes` of them, and none that is rounding only.
Pod pod(const SnapshotMatrix& snapshots, int modes, PodMean about = PodMean::removed);

/// Coefficients of other rows (without the mean) in a basis of pod(): least squares, [rows, modes].
Eigen::MatrixXd project(const SnapshotMatrix& rows, const Pod& pod, int modes);

}  // namespace graupel::train
