// Runs MPM or one of its cheaper variants on a scene and measures what that costs.
#pragma once

#include <cstdint>
#include <string>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "experiments/models/start_state.h"
#include "experiments/models/timed_run.h"
#include "mpm/scene_variants.h"

namespace graupel::experiments {

struct MpmRunOptions {
  mpm::SolverVariant variant = {};
  Device device = Device::cpu;
  uint64_t seed = 0;
  int64_t frames = 0;
  std::string label;  ///< of the progress line
  /// Particles whose places the run tells instead of its own: on another grid it carries them as tracers, so that it is
  /// judged on the truth's particles. Not owned; null: its own.
  const StartState* tracers = nullptr;
  double displacement = 0;      ///< of every particle's start in a random direction [m] (move_births)
  bool contact_forces = false;  ///< also what it does to obstacles and walls, by a second run that is not timed
  bool must_finish = false;     ///< throw DivergedError instead of returning the frames before it (the truth)
};
/// The scene with its own grid and step, whatever options.variant says.
TimedRun run_scene(const Scene& scene, const MpmRunOptions& options);

/// Frames after a divergence repeat the last usable one. Throws DivergedError where options.must_finish.
TimedRun run_mpm(const Scene& scene, const MpmRunOptions& options);

}  // namespace graupel::experiments
