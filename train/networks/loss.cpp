#include "train/networks/loss.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/sum.h>

#include <algorithm>

namespace graupel::train {

AccelerationLoss::AccelerationLoss(const at::Tensor& accelerations, const DeviceBatch& batch, bool plane)
    : difference_(accelerations - batch.target),
      predictions_(
          static_cast<double>(std::max<int64_t>(1, batch.particles - batch.uncounted) * difference_.size(1) / 3)) {
  if (batch.uncounted > 0) difference_.mul_(batch.counted);
  if (plane) difference_.view({batch.particles, -1, 3}).select(2, 2).zero_();
}

at::Tensor AccelerationLoss::value() const { return at::sum(difference_ * difference_) / predictions_; }
at::Tensor AccelerationLoss::gradient() const { return difference_ * (2.0 / predictions_); }

}  // namespace graupel::train
