// A matrix of snapshots by blocks of columns, so that it need not fit into memory: what a decomposition needs are sums
// over columns (the Gram matrix) and columns one by one (the modes).
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "rom/cubature/quadrature.h"
#include "train/reduced/snapshot_set.h"

namespace graupel::train {

/// A snapshot a row.
using SnapshotMatrix = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

class SnapshotBlocks {
 public:
  virtual ~SnapshotBlocks() = default;
  virtual Eigen::Index snapshots() const = 0;
  virtual Eigen::Index width() const = 0;  ///< columns of all blocks
  virtual int blocks() const = 0;
  virtual Eigen::Index first_column(int block) const = 0;
  /// The block's columns, until the next one is asked for. A block that is asked for again at once costs nothing.
  virtual SnapshotMatrix load(int block) = 0;

  /// Columns that are multiplied together. Blocks hold whole pieces, so that sums do not depend on the blocks.
  static constexpr Eigen::Index piece = 2304;  // of 3, 6 and 9 components
};

/// A matrix in memory as one block.
class MatrixBlocks final : public SnapshotBlocks {
 public:
  explicit MatrixBlocks(const SnapshotMatrix& matrix) : matrix_(matrix) {}
  Eigen::Index snapshots() const override { return matrix_.rows(); }
  Eigen::Index width() const override { return matrix_.cols(); }
  int blocks() const override { return 1; }
  Eigen::Index first_column(int) const override { return 0; }
  SnapshotMatrix load(int) override { return matrix_; }

 private:
  SnapshotMatrix matrix_;
};

/// Every n-th snapshot of others, from the first on.
class EveryNthBlocks final : public SnapshotBlocks {
 public:
  /// `all` must outlive this.
  EveryNthBlocks(SnapshotBlocks& all, Eigen::Index n) : all_(all), n_(n) {}
  Eigen::Index snapshots() const override { return (all_.snapshots() + n_ - 1) / n_; }
  Eigen::Index width() const override { return all_.width(); }
  int blocks() const override { return all_.blocks(); }
  Eigen::Index first_column(int block) const override { return all_.first_column(block); }
  SnapshotMatrix load(int block) override;

 private:
  SnapshotBlocks& all_;
  Eigen::Index n_;
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> chosen_;  ///< of the loaded block
};

/// A field of a sweep, or its means over clusters of particles, which take the memory of the clusters alone. Every
/// block reads the whole file.
class FieldBlocks final : public SnapshotBlocks {
 public:
  /// `clusters`: null for the particles themselves. `most_bytes`: of a block; a block of one piece may take more.
  FieldBlocks(const SnapshotSet& set, SnapshotField field, const rom::Clusters* clusters, double most_bytes);
  Eigen::Index snapshots() const override { return static_cast<Eigen::Index>(set_.snapshots()); }
  Eigen::Index width() const override { return static_cast<Eigen::Index>(points_ * components_); }
  int blocks() const override { return static_cast<int>((points_ + block_points_ - 1) / block_points_); }
  Eigen::Index first_column(int block) const override { return block * block_points_ * components_; }
  SnapshotMatrix load(int block) override;
  /// Seconds spent reading.
  double seconds() const { return seconds_; }

 private:
  const SnapshotSet& set_;
  SnapshotField field_;
  const rom::Clusters* clusters_;
  int64_t points_, components_, block_points_;
  std::vector<float> members_;  ///< of every cluster
  std::vector<float> values_;   ///< of the loaded block
  int loaded_ = -1;
  double seconds_ = 0;
};

}  // namespace graupel::train
