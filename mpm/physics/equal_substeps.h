// Substeps of a frame for the policies that settle them at its start (StepPolicy::fixed and per_frame), on any device.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/parallel/host_device.h"
#include "core/scene/time_step_config.h"

namespace graupel::mpm {

inline constexpr double most_substeps = 1e6;

/// n = max(substeps_per_frame, |v| T / (courant dx)) of a frame of T [s] in which nothing is faster than `speed` [m/s];
/// the first alone for fixed steps. 0 where more than most_substeps are needed.
GRAUPEL_HD inline int64_t equal_substeps(const TimeStep& policy, double dx, double frame_time, double speed) {
  if (policy.policy != StepPolicy::per_frame) return policy.substeps_per_frame;
  const double needed = ceil(speed * frame_time / (policy.courant * dx));
  if (!(needed <= most_substeps)) return 0;
  const auto steps = static_cast<int64_t>(needed);
  return steps > policy.substeps_per_frame ? steps : policy.substeps_per_frame;
}

}  // namespace graupel::mpm
