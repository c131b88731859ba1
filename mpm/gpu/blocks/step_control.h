// The course of a scene on the device: size of the next substep, end of the frame, divergence. One thread a scene.
#pragma once

#include <cmath>

#include "mpm/gpu/blocks/batch_view.h"
#include "mpm/physics/equal_substeps.h"

namespace graupel::mpm {

/// As mpm/solver/time_step.h for the adaptive policy, without exceptions: the step with `left` seconds of the frame to
/// go, or 0 when the frame would need over a million steps.
GRAUPEL_HD inline double device_step(const TimeStep& policy, double dx, double frame_time, double speed,
                                     double sound_speed, double diffusivity, double left) {
  const double rate = (speed + sound_speed) / (policy.courant * dx) + 6 * diffusivity / (dx * dx);
  double limit = rate > 0 ? 1 / rate : policy.max_step;
  limit = limit > policy.min_step ? limit : policy.min_step;
  limit = limit < policy.max_step ? limit : policy.max_step;
  limit = limit < frame_time ? limit : frame_time;
  if (!(left / limit <= most_substeps)) return 0;
  const double steps = ceil(left / limit - 1e-9);
  return left / (steps > 1 ? steps : 1);
}

GRAUPEL_HD inline bool has_equal_steps(const BatchScene& scene) {
  return scene.time_step.policy != StepPolicy::adaptive;
}

/// 0 when the frame would need over a million steps.
GRAUPEL_HD inline double equal_step(const BatchScene& scene, const SceneProgress& control) {
  return control.equal_substeps > 0 ? scene.frame_time / static_cast<double>(control.equal_substeps) : 0.0;
}

GRAUPEL_HD inline void choose_step(const BatchScene& scene, SceneProgress& control) {
  const double left = scene.frame_time - control.elapsed;
  const double dt = has_equal_steps(scene)
                        ? equal_step(scene, control)
                        : device_step(scene.time_step, static_cast<double>(scene.view.grid.dx), scene.frame_time,
                                      control.speed, control.sound_speed, scene.diffusivity, left);
  control.dt = static_cast<float>(dt);
  if (!(dt > 0)) control.phase = ScenePhase::too_stiff;
}

/// Substeps between two sorts: those that the fastest particle needs for most of the cell that it may go beyond its
/// block, a multiple of eight.
inline constexpr int32_t shortest_interval = 8, longest_interval = 64;
GRAUPEL_HD inline int32_t interval_of_sorts(const BatchScene& scene, const SceneProgress& control) {
  const double way = control.speed * static_cast<double>(control.dt) / static_cast<double>(scene.view.grid.dx);
  int32_t interval = shortest_interval;
  while (interval < longest_interval && (interval + shortest_interval) * way <= 0.9) interval += shortest_interval;
  return interval;
}

/// Every frame starts with a sort. `substeps`: of the frame, where they are equal; 0: over a million.
GRAUPEL_HD inline void begin_frame(const BatchScene& scene, int64_t substeps, SceneProgress& control) {
  if (control.phase != ScenePhase::frame_done) return;
  control.phase = ScenePhase::unsorted;
  control.elapsed = 0;
  control.frame_substeps = 0;
  control.equal_substeps = static_cast<int32_t>(substeps);
  choose_step(scene, control);
  control.sort_interval = interval_of_sorts(scene, control);
}
GRAUPEL_HD inline void begin_frame(const BatchScene& scene, SceneProgress& control) {
  begin_frame(scene,
              equal_substeps(scene.time_step, static_cast<double>(scene.view.grid.dx), scene.frame_time,
                             control.speed + scene.fall_speed),
              control);
}

GRAUPEL_HD inline void clear_report(StepReport& report) {
  report = {};
  report.bad_particle = no_bad_particle;
}

/// Counts substeps before the one that finish_substep() is about to end, which did not end the frame: speeds of the
/// last of them, and the largest sound speed of all.
GRAUPEL_HD inline void count_earlier_substeps(const BatchScene& scene, int32_t substeps, float speed2,
                                              float sound_speed, float peak_sound_speed, SceneProgress& control) {
  const double dt = static_cast<double>(control.dt);
  control.substeps += substeps;
  control.frame_substeps += substeps;
  control.since_sort += substeps;
  for (int32_t i = 0; i < substeps; ++i) control.elapsed += dt;
  control.speed = sqrt(static_cast<double>(speed2));
  control.sound_speed = static_cast<double>(sound_speed);
  const double courant = static_cast<double>(peak_sound_speed) * dt / static_cast<double>(scene.view.grid.dx);
  if (courant > control.sound_courant) control.sound_courant = courant;
}

/// Ends a substep: `found` is the report of all blocks.
GRAUPEL_HD inline void finish_substep(const BatchScene& scene, const StepReport& found, float largest_speed2,
                                      float largest_sound_speed, SceneProgress& control) {
  const double dt = static_cast<double>(control.dt), left = scene.frame_time - control.elapsed;
  ++control.substeps;
  ++control.frame_substeps;
  ++control.since_sort;
  control.before_speed = control.speed;
  control.before_sound = control.sound_speed;
  control.speed = sqrt(static_cast<double>(largest_speed2));
  control.sound_speed = static_cast<double>(largest_sound_speed);
  control.pushed_out += static_cast<int64_t>(found.pushed_out);
  for (int d = 0; d < 3; ++d) {
    control.pushed_momentum[d] += static_cast<int64_t>(found.pushed_momentum[d]);
    control.scripted_momentum[d] += static_cast<int64_t>(found.scripted_momentum[d]);
  }
  const double courant = control.sound_speed * dt / static_cast<double>(scene.view.grid.dx);
  if (courant > control.sound_courant) control.sound_courant = courant;
  if (found.bad_particle != no_bad_particle) {
    control.bad_particle = found.bad_particle;
    control.phase = ScenePhase::diverged;
    return;
  }
  const bool last = has_equal_steps(scene) ? control.frame_substeps == control.equal_substeps : dt >= left * (1 - 1e-6);
  if (last) {
    if (found.over_courant > control.over_courant) control.over_courant = found.over_courant;
    control.phase = ScenePhase::frame_done;
    return;
  }
  control.elapsed += dt;
  const bool sort = found.left_halo > 0 || control.since_sort >= control.sort_interval;
  control.phase = sort ? ScenePhase::unsorted : ScenePhase::running;
  choose_step(scene, control);
}

}  // namespace graupel::mpm
