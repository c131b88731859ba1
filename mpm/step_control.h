// The course of a scene on the device: size of the next substep, end of the frame, divergence. One thread a scene.
#pragma once

#include <cmath>

#include "mpm/batch_view.h"

namespace graupel::mpm {

/// As mpm/time_step.h, without exceptions: the step with `left` seconds of the frame to go, or 0 when the frame would
/// need over a million steps.
GRAUPEL_HD inline double device_step(const TimeStep& policy, double dx, double frame_time, double speed,
                                     double sound_speed, double diffusivity, double left) {
  if (policy.policy == StepPolicy::fixed) return frame_time / static_cast<double>(policy.substeps_per_frame);
  const double rate = (speed + sound_speed) / (policy.courant * dx) + 6 * diffusivity / (dx * dx);
  double limit = rate > 0 ? 1 / rate : policy.max_step;
  limit = limit > policy.min_step ? limit : policy.min_step;
  limit = limit < policy.max_step ? limit : policy.max_step;
  limit = limit < frame_time ? limit : frame_time;
  if (!(left / limit <= 1e6)) return 0;
  const double steps = ceil(left / limit - 1e-9);
  return left / (steps > 1 ? steps : 1);
}

GRAUPEL_HD inline void choose_step(const BatchScene& scene, StepControl& control) {
  const double left = scene.frame_time - control.elapsed;
  const double dt = device_step(scene.time_step, static_cast<double>(scene.view.grid.dx), scene.frame_time,
                                control.speed, control.sound_speed, scene.diffusivity, left);
  control.dt = static_cast<float>(dt);
  if (!(dt > 0)) control.phase = ScenePhase::too_stiff;
}

/// Every frame starts with a sort.
GRAUPEL_HD inline void begin_frame(const BatchScene& scene, StepControl& control) {
  if (control.phase != ScenePhase::frame_done) return;
  control.phase = ScenePhase::unsorted;
  control.elapsed = 0;
  control.frame_substeps = 0;
  choose_step(scene, control);
}

GRAUPEL_HD inline void clear_report(StepReport& report) {
  report = {};
  report.bad_particle = no_bad_particle;
}

/// Ends a substep: `found` is the report of all blocks.
GRAUPEL_HD inline void finish_substep(const BatchScene& scene, const StepReport& found, float largest_speed2,
                                      float largest_sound_speed, StepControl& control) {
  const double dt = static_cast<double>(control.dt), left = scene.frame_time - control.elapsed;
  ++control.substeps;
  ++control.frame_substeps;
  control.before_speed = control.speed;
  control.before_sound = control.sound_speed;
  control.speed = sqrt(static_cast<double>(largest_speed2));
  control.sound_speed = static_cast<double>(largest_sound_speed);
  control.pushed_out += static_cast<int64_t>(found.pushed_out);
  for (int d = 0; d < 3; ++d) control.pushed_momentum[d] += static_cast<int64_t>(found.pushed_momentum[d]);
  const double courant = control.sound_speed * dt / static_cast<double>(scene.view.grid.dx);
  if (courant > control.sound_courant) control.sound_courant = courant;
  if (found.bad_particle != no_bad_particle) {
    control.bad_particle = found.bad_particle;
    control.phase = ScenePhase::diverged;
    return;
  }
  const bool fixed = scene.time_step.policy == StepPolicy::fixed;
  const bool last = fixed ? control.frame_substeps == scene.time_step.substeps_per_frame : dt >= left * (1 - 1e-6);
  if (last) {
    if (found.over_courant > control.over_courant) control.over_courant = found.over_courant;
    control.phase = ScenePhase::frame_done;
    return;
  }
  control.elapsed += dt;
  control.phase = found.left_reach > 0 ? ScenePhase::unsorted : ScenePhase::running;
  choose_step(scene, control);
}

}  // namespace graupel::mpm
