#include "mpm/solver/time_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "mpm/physics/equal_substeps.h"

namespace graupel::mpm {

namespace {

constexpr double usual_courant = 0.3;

/// Largest stable step at a courant number [s]; infinite for a state at rest without waves.
double stable_step(double courant, double dx, const StateSpeeds& s) {
  return 1 / ((s.speed + s.scripted + s.sound_speed) / (courant * dx) + 6 * s.diffusivity / (dx * dx));
}

[[noreturn]] void throw_endless(const TimeStep& policy, double dx, double limit, const StateSpeeds& speeds) {
  const char* key = policy.policy != StepPolicy::adaptive ? nullptr : policy.max_step <= limit ? "max_step" : "courant";
  if (key != nullptr && usual_step(dx, speeds) > 100 * limit)
    throw ConfigError(fmt::format("time_step.{} = {:.3g} makes steps of {:.3g} s, over a million a frame. Raise it",
                                  key, policy.max_step <= limit ? policy.max_step : policy.courant, limit));
  throw DivergedError(fmt::format(
      "the stable step fell to {:.3g} s (sound speed {:.4g} m/s, speed {:.4g} m/s, obstacles {:.4g} m/s, kinematic "
      "viscosity {:.4g} m^2/s, over a million steps a frame). Cap the hardening of snow (max_hardening), lower the "
      "stiffness, the viscosity or the speed, or raise dx",
      limit, speeds.sound_speed, speeds.speed, speeds.scripted, speeds.diffusivity));
}

}  // namespace

double largest_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds) {
  if (policy.policy != StepPolicy::adaptive) {
    const double fastest = speeds.speed + speeds.scripted + speeds.fall;
    const int64_t substeps = equal_substeps(policy, dx, frame_time, fastest);
    if (substeps == 0) throw_endless(policy, dx, policy.courant * dx / fastest, speeds);
    return frame_time / static_cast<double>(substeps);
  }
  const double stable = std::max(stable_step(policy.courant, dx, speeds), policy.min_step);
  return std::min({stable, policy.max_step, frame_time});
}

double next_step(const TimeStep& policy, double dx, double frame_time, const StateSpeeds& speeds, double left) {
  const double limit = largest_step(policy, dx, frame_time, speeds);
  if (!(left / limit <= most_substeps)) throw_endless(policy, dx, limit, speeds);
  return left / std::max(1.0, std::ceil(left / limit - 1e-9));
}

void check_scripted_speed(const Scene& scene, double speed) {
  if (scene.time_step.policy != StepPolicy::fixed) return;
  const double dt = scene.frame_time / static_cast<double>(scene.time_step.substeps_per_frame);
  const double cells = speed * dt / scene.domain.dx;
  if (cells > 1)
    throw ConfigError(fmt::format(
        "a scripted body or an emitter moves {:.3g} cells in a substep of {:.4g} s (at {:.4g} m/s, allowed: 1). Use at "
        "least {} substeps_per_frame, time_step.policy adaptive, or a slower motion",
        cells, dt, speed, static_cast<int64_t>(std::ceil(speed * scene.frame_time / scene.domain.dx))));
}

double usual_step(double dx, const StateSpeeds& speeds) { return stable_step(usual_courant, dx, speeds); }

double suggested_step(double dx, const StateSpeeds& speeds, double dt) {
  const double stable = usual_step(dx, speeds);
  return std::isfinite(stable) ? std::clamp(stable, dt / 8, dt / 2) : dt / 8;
}

}  // namespace graupel::mpm
