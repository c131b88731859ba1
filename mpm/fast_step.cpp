#include "mpm/fast_step.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <vector>

#include "core/system/error.h"

namespace graupel::mpm {

namespace {

Scene with_substeps(const Scene& scene, int64_t substeps) {
  Scene changed = scene;
  changed.time_step.policy = StepPolicy::fixed;
  changed.time_step.substeps_per_frame = substeps;
  return changed;
}

/// Frames until the last stream, burst or load has begun, and gravity no longer changes: before, a trial would look at
/// a part of the scene.
int64_t last_start(const Scene& scene) {
  double last = 0;
  for (const Emitter& emitter : scene.emitters) {
    const bool bursts = emitter.emission == Emission::burst;
    if (!bursts || !emitter.times.empty()) last = std::max(last, bursts ? emitter.times.back() : emitter.start_time);
  }
  for (const TimedLoad& load : scene.loads) last = std::max(last, load.start);
  if (scene.has_changing_gravity()) last = std::max(last, scene.gravity_keyframes.back().time);
  return static_cast<int64_t>(std::ceil(last / scene.frame_time));
}

struct Search {
  const SimulationOptions& options;
  int64_t frames;
  const std::function<void()>& every_frame;
  std::vector<double> energy;  ///< of the scene's own run after each frame [J]
  double largest_energy = 0;
  int64_t data_substeps = 0;

  static double energy_of(const Simulation& simulation) {
    const Diagnostics d = simulation.diagnostics();
    return d.kinetic_energy + d.elastic_energy;
  }

  void run_as_is(const Scene& scene) {
    const auto simulation = Simulation::create(scene, options);
    for (int64_t f = 0; f < frames; ++f) {
      if (every_frame) every_frame();
      simulation->advance_frame();
      energy.push_back(energy_of(*simulation));
      largest_energy = std::max(largest_energy, energy.back());
    }
    data_substeps = (simulation->statistics().substeps + frames - 1) / std::max<int64_t>(1, frames);
  }

  /// False also for a step in which a script or an emitter moves particles over a cell: creating the run refuses it.
  bool holds(const Scene& scene) const {
    std::unique_ptr<Simulation> simulation;
    try {
      simulation = Simulation::create(scene, options);
    } catch (const ConfigError&) {
      return false;
    }
    try {
      for (const double expected : energy) {
        if (every_frame) every_frame();
        simulation->advance_frame();
        if (!(std::abs(energy_of(*simulation) - expected) <= fast_step_energy * largest_energy)) return false;
      }
    } catch (const DivergedError&) {
      return false;
    }
    return true;
  }
};

}  // namespace

FastStep find_fast_step(const Scene& scene, const SimulationOptions& options, int64_t frames,
                        const std::function<void()>& every_frame) {
  const auto start = std::chrono::steady_clock::now();
  Search search{options, std::min(frames, last_start(scene) + fast_step_frames), every_frame, {}};
  search.run_as_is(scene);
  FastStep result{scene, search.data_substeps, search.data_substeps, 1, 0};
  int64_t fails = 0;
  while (result.substeps - fails > 1) {
    const int64_t middle = (fails + result.substeps) / 2;
    const Scene trial = with_substeps(scene, middle);
    ++result.trials;
    if (search.holds(trial)) {
      result.scene = trial;
      result.substeps = middle;
    } else {
      fails = middle;
    }
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

FastStep shorter_step(const FastStep& step, const Scene& original) {
  FastStep next = step;
  next.substeps = std::min(step.data_substeps, step.substeps + std::max<int64_t>(1, step.substeps / 8));
  next.scene = next.substeps < step.data_substeps ? with_substeps(original, next.substeps) : original;
  return next;
}

}  // namespace graupel::mpm
