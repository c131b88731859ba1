// The motion of a scripted body over one substep as a velocity field: the straight way from where a point is to where
// the script takes it. Material that follows it ends exactly on the body's pose at the end of the substep.
#pragma once

#include "core/scene/motion.h"

namespace graupel::mpm {

/// v(x) = gradient (x - center) + velocity.
template <typename T>
struct RigidStep {
  Mat<T, 3> gradient;  ///< (R - I) / dt with the rotation R of the substep [1/s]
  Vec<T, 3> center;    ///< where the body's centre is at the start of the substep [m]
  Vec<T, 3> velocity;  ///< of that centre [m/s]

  GRAUPEL_HD Vec<T, 3> velocity_at(const Vec<T, 3>& x) const { return gradient * (x - center) + velocity; }
};

/// The same without its part along z, for plane runs: rounding only, where the motion lies in the plane.
template <typename T>
RigidStep<T> in_plane(RigidStep<T> step) {
  step.velocity[2] = T(0);
  for (int d = 0; d < 3; ++d) step.gradient(2, d) = step.gradient(d, 2) = T(0);
  return step;
}

/// The substep of `dt` seconds from `time` on.
template <typename T>
RigidStep<T> rigid_step(const Motion& motion, const Vec3d& body_center, double time, double dt) {
  const Vec3d center = motion.center.value_or(body_center);
  const RigidMap from = motion.at(time, body_center), to = motion.at(time + dt, body_center);
  const Mat3d relative_rotation = to.rotation * transpose(from.rotation);
  return {((1 / dt) * (relative_rotation - Mat3d::identity())).cast<T>(), from(center).cast<T>(),
          ((to(center) - from(center)) * (1 / dt)).cast<T>()};
}

}  // namespace graupel::mpm
