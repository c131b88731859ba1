// Which models of a comparison run on which of its scenes, found out before anything is run.
#pragma once

#include <vector>

#include "experiments/comparison/compare_scene.h"

namespace graupel::experiments {

/// The models that run on each of the scenes. Throws ConfigError that names every scene that MPM does not run, and
/// every scene and model that do not go together, all at once: number of dimensions, frame time, cell size and
/// materials of networks; scene, seed and particles of reduced-order models, left out instead with
/// OtherScenes::leave_out; memory of MPM. `training_runs` may be null.
std::vector<std::vector<ComparedModel>> fitting_models(const std::vector<SceneTask>& tasks,
                                                       const std::vector<ComparedModel>& models,
                                                       const CompareOptions& options, const TrainingRuns* training_runs,
                                                       Device device);

}  // namespace graupel::experiments
