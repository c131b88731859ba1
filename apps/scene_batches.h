// Runs the scenes of a recipe in batches and writes each to a file of its own. While a batch advances, its last frames
// are compressed and written, and on a GPU the next batch is prepared.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/device.h"
#include "core/particle_fields.h"
#include "core/scene_recipe.h"
#include "mpm/scene_recipe.h"

namespace graupel::apps {

struct SceneJob {
  mpm::Split split;
  int64_t index;
  int64_t attempt = 0;  ///< redraws so far
};

struct SceneBatchOptions {
  uint64_t seed = 0;
  Device device = Device::cpu;
  FieldSet fields = {};
  int64_t batch = 1;                                 ///< scenes that advance together
  int64_t minutes = 0;                               ///< start no scene after this time; 0: no limit
  std::function<std::string(const SceneJob&)> file;  ///< where a scene goes
  std::function<void(const SceneJob&, const std::string& reason)> log_redraw;  ///< called by one thread at a time
};

/// Scenes that advance together unless the user says otherwise: as many as fill a GPU; on the CPU a thread each.
int64_t default_batch(Device device);

/// Runs `jobs` until they are done, the time is up or a stop signal came. A scene that diverges is drawn anew, up to 20
/// times. Throws DivergedError after that, and the errors of the solver and the writer. Unfinished files are removed.
void run_scenes(const SceneRecipe& recipe, const std::vector<SceneJob>& jobs, const SceneBatchOptions& options);

}  // namespace graupel::apps
