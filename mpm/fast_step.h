// The largest step with which a scene still runs as it does with its own: what mpm:fast runs with.
#pragma once

#include <cstdint>
#include <functional>

#include "core/scene/scene.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Frames that a trial step has to hold for, at most; from the last emitter's start on.
constexpr int64_t fast_step_frames = 60;
/// Largest deviation of a trial's kinetic + elastic energy in any frame, as a share of the largest of the scene's own
/// run. Stable runs of mixed scenes differ by up to 0.06; beyond the limit a run ends by itself within frames.
constexpr double fast_step_energy = 0.1;

struct FastStep {
  Scene scene;                ///< with `substeps` fixed substeps a frame, or as it was when no larger step holds
  int64_t substeps = 0;       ///< a frame
  int64_t data_substeps = 0;  ///< of the scene's own run, mean a frame (rounded up)
  int64_t trials = 0;         ///< runs that the search took, the scene's own among them
  double seconds = 0;         ///< wall time of the search
};

/// Bisects the number of substeps a frame below the scene's own. A trial holds when it runs min(frames,
/// fast_step_frames) frames without its blow-up test (NaN, det F <= 0, a particle over a cell in a substep) and with
/// the energy of the scene's own run, and when no script or emitter moves particles over a cell in a substep.
/// `every_frame` is called between frames and may throw. Throws DivergedError when the scene does not run with its own
/// step.
FastStep find_fast_step(const Scene& scene, const SimulationOptions& options, int64_t frames,
                        const std::function<void()>& every_frame = {});

/// The next shorter step (an eighth more substeps), for a run that blew up later than the trials looked; the scene's
/// own step, `original`, in the end.
FastStep shorter_step(const FastStep& step, const Scene& original);

}  // namespace graupel::mpm
