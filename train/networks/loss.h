// The training loss: mean square error of normalised accelerations (HGN paper, section 4.2; GNS, Sanchez-Gonzalez et
// al. 2020, section 4.3). Internal, as device_batch.h.
#pragma once

#include "train/networks/device_batch.h"

namespace graupel::train {

/// (1 / N) sum over the counted particles and the frames of a bundle of |a - a_target|^2, N their number. Particles
/// whose positions are prescribed (obstacles, stationary ones) do not count, nor do those that leave within the bundle;
/// of plane scenes nor does z.
class AccelerationLoss {
 public:
  /// `accelerations` [particles, 3 frames], as batch.target.
  AccelerationLoss(const at::Tensor& accelerations, const DeviceBatch& batch, bool plane);

  at::Tensor value() const;  ///< scalar, on the device
  /// By the accelerations.
  at::Tensor gradient() const;

 private:
  at::Tensor difference_;
  double predictions_;  ///< N
};

}  // namespace graupel::train
