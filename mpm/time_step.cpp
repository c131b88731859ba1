#include "mpm/time_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace graupel::mpm {

double largest_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds) {
  if (policy.policy == StepPolicy::fixed) return frame_time / static_cast<double>(policy.substeps_per_frame);
  const double fastest = speeds.speed + speeds.scripted + speeds.sound_speed;
  const double stable = fastest > 0 ? policy.courant * dx / fastest : policy.max_step;
  return std::min({std::max(stable, policy.min_step), policy.max_step, frame_time});
}

double next_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds, double left) {
  const double limit = largest_step(policy, dx, frame_time, speeds);
  constexpr double most_steps = 1e6;
  if (!(left / limit <= most_steps))
    throw DivergedError(
        fmt::format("the stable step fell to {:.3g} s (sound speed {:.4g} m/s, speed {:.4g} m/s, obstacles {:.4g} m/s, "
                    "over a million steps a "
                    "frame). "
                    "Cap the hardening of snow (max_hardening), lower the stiffness or raise dx",
                    limit, speeds.sound_speed, speeds.speed, speeds.scripted));
  return left / std::max(1.0, std::ceil(left / limit - 1e-9));
}

double suggested_step(double dx, const StateSpeeds& speeds, double dt) {
  const double stable = 0.3 * dx / (speeds.speed + speeds.scripted + speeds.sound_speed);
  return std::isfinite(stable) ? std::clamp(stable, dt / 8, dt / 2) : dt / 8;
}

}  // namespace graupel::mpm
