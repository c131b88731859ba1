// Runs the scenes of a data set in batches and writes each to a file of its own. While a batch advances, its last
// frames are compressed and written, and on a GPU the next batch is prepared.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "experiments/data/scene_source.h"

namespace graupel::experiments {

struct SceneBatchOptions {
  Device device = Device::cpu;
  int64_t batch = 1;                                 ///< scenes that advance together
  double minutes = 0;                                ///< start no scene after this time; 0: no limit
  std::function<std::string(const SceneJob&)> file;  ///< where a scene goes
  std::function<void(const SceneJob&, const std::string& reason)> diverged;  ///< called by one thread at a time
};

/// Runs `jobs` until they are done, the time is up or a stop signal came. A scene that diverges is told of; where the
/// source says so, it is drawn anew, up to 20 times. Throws DivergedError after that, and the errors of the solver and
/// the writer. Unfinished files are removed.
void run_scenes(const SceneSource& source, const std::vector<SceneJob>& jobs, const SceneBatchOptions& options);

}  // namespace graupel::experiments
