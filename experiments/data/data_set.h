// Makes a data set in a folder: each scene is one file until all are there; then each split becomes one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "experiments/data/scene_source.h"
#include "experiments/data/shard.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

struct DataSetOptions {
  std::string folder;
  Device device = Device::cpu;
  Shard shard;
  int64_t batch = 0;                   ///< scenes that advance together; 0: the source's choice
  double minutes = 0;                  ///< start no scene after this time; 0: no limit
  double connectivity_radius = 0.035;  ///< written to metadata.json [m]
};

/// Makes the scenes of the shard that the folder lacks, and the files of the splits that are then whole; returns what
/// is there. Throws ConfigError for a folder of another recipe, seed, device or fields; DivergedError, with every scene
/// that diverged, where the source draws no other in its place: nothing is merged then.
nlohmann::ordered_json make_data_set(const SceneSource& source, const DataSetOptions& options);

}  // namespace graupel::experiments
