// Statistics of the motion in a data set: differences of frames, over particles that move by themselves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/math/vec.h"

namespace graupel::io {

/// Mean and standard deviation of each axis in double precision.
class Moments {
 public:
  void add(const Vec3d& value) {
    for (int axis = 0; axis < 3; ++axis) {
      sum_[axis] += value[axis];
      square_[axis] += value[axis] * value[axis];
    }
    ++count_;
  }
  void add(const Moments& more) {
    sum_ += more.sum_;
    square_ += more.square_;
    count_ += more.count_;
  }
  Vec3d mean() const { return sum_ * (1 / std::max(count_, 1.0)); }
  Vec3d deviation() const {
    Vec3d out;
    for (int axis = 0; axis < 3; ++axis)
      out[axis] = std::sqrt(std::max(0.0, square_[axis] / std::max(count_, 1.0) - mean()[axis] * mean()[axis]));
    return out;
  }

 private:
  Vec3d sum_ = Vec3d::zero(), square_ = Vec3d::zero();
  double count_ = 0;
};

struct MotionStatistics {
  Moments velocity;      ///< v_t = x_t - x_(t-1) [m/frame]
  Moments acceleration;  ///< v_(t+1) - v_t [m/frame^2]
  void add(const MotionStatistics& more) {
    velocity.add(more.velocity);
    acceleration.add(more.acceleration);
  }
};

/// The way from one frame to the next [m], through a periodic wall where that is shorter; `period` is 0 along axes
/// without one.
inline Vec3d displacement(const Vec3f& from, const Vec3f& to, const Vec3d& period) {
  Vec3d way = to.cast<double>() - from.cast<double>();
  for (int axis = 0; axis < 3; ++axis)
    if (period[axis] > 0) way[axis] -= period[axis] * std::round(way[axis] / period[axis]);
  return way;
}

}  // namespace graupel::io
