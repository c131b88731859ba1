#include "train/networks/loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/logical_and.h>
#include <ATen/ops/ne.h>
#include <ATen/ops/sum.h>

#include <algorithm>

#include "graph/features/feature_row.h"

namespace graupel::train {

AccelerationLoss::AccelerationLoss(const at::Tensor& accelerations, const DeviceBatch& batch, bool plane)
    : difference_(accelerations - batch.target),
      predictions_(static_cast<double>(std::max<int64_t>(1, batch.particles - batch.kinematic_count) *
                                       difference_.size(1) / 3)) {
  if (batch.kinematic_count > 0) {
    const at::Tensor row = batch.type_row.narrow(0, 0, batch.particles);
    const at::Tensor moves = at::ne(row, graph::obstacle_row).logical_and(at::ne(row, graph::stationary_row));
    difference_.mul_(moves.view({-1, 1}));
  }
  if (plane) difference_.view({batch.particles, -1, 3}).select(2, 2).zero_();
}

at::Tensor AccelerationLoss::value() const { return at::sum(difference_ * difference_) / predictions_; }
at::Tensor AccelerationLoss::gradient() const { return difference_ * (2.0 / predictions_); }

}  // namespace graupel::train
