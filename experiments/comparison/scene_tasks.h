// The scenes of a comparison, from scene files, folders of them, data sets and recipes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "experiments/comparison/compare_runs.h"

namespace graupel::experiments {

/// A scene to compare on, and where its truth comes from.
struct SceneTask {
  Scene scene;
  std::string source;    ///< file, "file#3" for a trajectory of a data set or a scene of a recipe
  std::string category;  ///< of the recipe of categories that drew it; empty for none
  uint64_t seed = 0;
  int64_t frames = 0;
  std::optional<Trajectory> stored;     ///< truth of a data set
  std::vector<Vec3f> initial_velocity;  ///< [m/s], of a data set
  compare::ContactForces forces;        ///< of a data set that keeps them
};

/// Files, folders and recipes of --scenes, in order. Throws ConfigError (also for an unknown split, one that is missing
/// or of no use, and more scenes than there are) and InputError.
std::vector<SceneTask> read_scene_tasks(const CompareOptions& options);

}  // namespace graupel::experiments
