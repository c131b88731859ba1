// Baselines of reduced-order models as runs of a scene, judged like every other model: nothing moves, the nearest
// training run, and linear interpolation between the training runs around (outside of them extrapolation from the
// nearest).
#pragma once

#include <string>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "experiments/comparison/scene_tasks.h"
#include "experiments/models/reduced_model.h"
#include "experiments/models/timed_run.h"
#include "experiments/models/training_runs.h"

namespace graupel::experiments {

struct BaselineRun {
  std::string name;  ///< "nothing-moves", "nearest-run", "between-runs" or "beyond-runs"
  std::string note;  ///< which training runs
  TimedRun timed;    ///< a frame's time is that of reading and mixing it
};

/// Most that there are for a scene.
inline constexpr std::size_t most_baselines = 3;

/// Throws ConfigError where the scene or the model's parameters are not those of the training runs.
void check_training_runs(const TrainingRuns& runs, const LoadedModel& model, const SceneTask& task);

/// Without training runs nothing-moves alone; without between-runs and beyond-runs where the training runs span no
/// simplex. Runs of the same body with other particles are carried to the truth's by moving least squares. Throws
/// InputError where the training runs have other particles than their scene or, on the truth's, than the truth.
std::vector<BaselineRun> baseline_runs(const TrainingRuns* runs, const SceneTask& task,
                                       const compare::ParticleRun& truth);

}  // namespace graupel::experiments
