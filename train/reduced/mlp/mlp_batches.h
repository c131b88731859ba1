// Which snapshots and points the batches of a stage hold: every snapshot once an epoch, in an order of its own, and
// points drawn anew for each batch. A batch depends on (seed, stage, step) alone.
#pragma once

#include <numeric>
#include <utility>

#include "core/math/random.h"
#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

class MlpBatches {
 public:
  MlpBatches(uint64_t seed, int stage, int64_t snapshots, int64_t points, int64_t batch_snapshots, int64_t batch_points)
      : order_(seed, RandomPurpose::batch_order, static_cast<uint64_t>(2 * stage)),
        draw_(seed, RandomPurpose::batch_order, static_cast<uint64_t>(2 * stage + 1)),
        snapshots_(snapshots),
        points_(points),
        batch_snapshots_(std::min(batch_snapshots, snapshots)),
        batch_points_(std::min(batch_points, points)) {}

  double steps_per_epoch() const { return static_cast<double>(snapshots_) / static_cast<double>(batch_snapshots_); }
  /// `step` counts from 0.
  MlpBatch batch(int64_t step) {
    MlpBatch batch;
    for (int64_t i = step * batch_snapshots_; i < (step + 1) * batch_snapshots_; ++i)
      batch.snapshots.push_back(permutation(i / snapshots_)[static_cast<std::size_t>(i % snapshots_)]);
    batch.points.resize(static_cast<std::size_t>(batch_points_));
    if (batch_points_ == points_) {
      std::iota(batch.points.begin(), batch.points.end(), int64_t{0});
      return batch;
    }
    for (int64_t i = 0; i < batch_points_; ++i)
      batch.points[static_cast<std::size_t>(i)] =
          draw_.integer(static_cast<uint64_t>(step * batch_points_ + i), 0, static_cast<uint32_t>(points_));
    return batch;
  }

 private:
  const std::vector<int64_t>& permutation(int64_t epoch) {
    if (epoch == epoch_) return permutation_;
    epoch_ = epoch;
    permutation_.resize(static_cast<std::size_t>(snapshots_));
    std::iota(permutation_.begin(), permutation_.end(), int64_t{0});
    for (int64_t i = snapshots_ - 1; i > 0; --i)
      std::swap(
          permutation_[static_cast<std::size_t>(i)],
          permutation_[order_.integer(static_cast<uint64_t>(epoch * snapshots_ + i), 0, static_cast<uint32_t>(i + 1))]);
    return permutation_;
  }

  Random order_, draw_;
  int64_t snapshots_, points_, batch_snapshots_, batch_points_;
  int64_t epoch_ = -1;
  std::vector<int64_t> permutation_;
};

}  // namespace graupel::train
