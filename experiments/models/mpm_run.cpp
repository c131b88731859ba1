#include "experiments/models/mpm_run.h"

#include <algorithm>
#include <memory>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "experiments/models/memory_meter.h"
#include "experiments/process/process.h"
#include "experiments/process/progress.h"
#include "mpm/fast_step.h"
#include "mpm/simulation.h"

namespace graupel::experiments {

namespace {

TimedRun run_once(const Scene& variant, const MpmRunOptions& options) {
  const MemoryMeter memory;
  DeviceMemoryMeter device_memory(options.device);
  const bool portable = options.tracers && options.device == Device::cuda;
  mpm::PreparedScene prepared(variant, {.device = options.device,
                                        .precision = mpm::Precision::f32,
                                        .seed = options.seed,
                                        .kernels = portable ? mpm::Kernels::portable : mpm::Kernels::tuned});
  if (options.displacement > 0) move_births(variant, options.seed, options.displacement, prepared.particles);
  const auto simulation = mpm::Simulation::create(prepared);
  TimedRun result;
  result.moved = simulation->particle_count();
  const StartState start = options.tracers ? *options.tracers : start_of(variant, options.seed);
  result.run.mass = start.mass;
  result.run.volume = start.volume;
  Trajectory& trajectory = result.run.trajectory;
  trajectory.particle_type = options.tracers ? start.particle_type : simulation->particle_type();
  if (options.tracers) simulation->carry_tracers(start.position, start.velocity, start.birth_time);
  const auto current_frame = [&] {
    if (!options.tracers) return simulation->frame();
    ParticleFrame frame;
    frame.time = simulation->time();
    frame.position = simulation->tracers();
    frame.active = simulation->active_tracers();
    return frame;
  };
  trajectory.frame_time = variant.frame_time;
  trajectory.seed = options.seed;
  trajectory.made_by = "mpm";
  trajectory.frames.push_back(current_frame());
  std::vector<double> solver, output;
  double carried = 0;  // time of the tracers so far, which are no part of the run
  Progress progress(options.label, options.frames);
  for (int64_t f = 1; f <= options.frames; ++f) {
    stop_if_interrupted();
    const Stopwatch watch;
    try {
      simulation->advance_frame();
    } catch (const DivergedError&) {
      if (options.must_finish) throw;
      trajectory.diverged_at_frame = f;
      break;
    }
    solver.push_back(watch.seconds() - (simulation->tracer_seconds() - carried));
    carried = simulation->tracer_seconds();
    const Stopwatch after;
    trajectory.frames.push_back(current_frame());
    output.push_back(after.seconds());
    trajectory.frames.back().velocity.clear();  // the comparison reads positions
    trajectory.frames.back().velocity.shrink_to_fit();
    progress.update(f);
  }
  if (trajectory.diverged_at_frame < 0) progress.done();
  device_memory.look();
  result.cost.device_bytes = device_memory.taken();
  result.cost.frame = median(solver);
  result.cost.output = median(output);
  const auto frames_run = static_cast<double>(std::max<std::size_t>(1, solver.size()));
  result.cost.substeps = static_cast<double>(simulation->statistics().substeps) / frames_run;
  result.cost.peak_bytes = memory.peak();
  result.cost.added_bytes = memory.added();
  compare::hold_last_frame(trajectory, static_cast<std::size_t>(options.frames));
  return result;
}

}  // namespace

namespace {

/// On a GPU the tuned kernels, which carry no tracers, tell the time, and the portable ones the places.
TimedRun run_timed(const Scene& scene, const MpmRunOptions& options) {
  if (options.tracers == nullptr || options.device == Device::cpu) return run_once(scene, options);
  MpmRunOptions timed = options;
  timed.tracers = nullptr;
  const TimedRun tuned = run_once(scene, timed);
  TimedRun result = run_once(scene, options);
  result.cost = tuned.cost;
  return result;
}

/// Of the same run, made again; up to the frame before a divergence.
compare::ContactForces forces_of(const Scene& scene, const MpmRunOptions& options) {
  mpm::PreparedScene prepared(
      scene,
      {.device = options.device, .precision = mpm::Precision::f32, .seed = options.seed, .contact_forces = true});
  if (options.displacement > 0) move_births(scene, options.seed, options.displacement, prepared.particles);
  const auto simulation = mpm::Simulation::create(prepared);
  compare::ContactForces forces{contact_names(scene), {simulation->contact_forces()}};
  for (int64_t f = 1; f <= options.frames; ++f) {
    stop_if_interrupted();
    try {
      simulation->advance_frame();
    } catch (const DivergedError&) {
      break;
    }
    forces.frames.push_back(simulation->contact_forces());
  }
  return forces;
}

}  // namespace

TimedRun run_scene(const Scene& scene, const MpmRunOptions& options) {
  TimedRun result = run_timed(scene, options);
  if (options.contact_forces) result.forces = forces_of(scene, options);
  return result;
}

namespace {

/// With the largest stable step, searched for; the search and every run that blew up all the same count as its cost.
TimedRun run_fast(const Scene& scene, const MpmRunOptions& options) {
  const mpm::SimulationOptions simulation{
      .device = options.device, .precision = mpm::Precision::f32, .seed = options.seed};
  mpm::FastStep step;
  try {
    step = mpm::find_fast_step(scene, simulation, options.frames, [] { stop_if_interrupted(); });
  } catch (const DivergedError&) {
    return run_scene(scene, options);  // a stored truth's scene, which does not run here with its own step
  }
  for (;;) {
    const Stopwatch watch;
    TimedRun result = run_scene(step.scene, options);
    result.cost.search = step.seconds;
    if (result.run.trajectory.diverged_at_frame < 0 || step.substeps >= step.data_substeps) return result;
    step = mpm::shorter_step(step, scene);
    step.seconds += watch.seconds();
  }
}

}  // namespace

TimedRun run_mpm(const Scene& scene, const MpmRunOptions& options) {
  const Scene variant = mpm::variant_scene(scene, options.variant);
  if (options.variant.step == mpm::StepRule::largest_stable) return run_fast(variant, options);
  return run_scene(variant, options);
}

}  // namespace graupel::experiments
