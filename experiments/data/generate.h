// graupel generate: recipe and seed become a data set.
#pragma once

#include <string>

#include "experiments/data/data_set.h"
#include "experiments/data/scene_source.h"
#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct GenerateOptions {
  CommonOptions common;
  SceneSourceOptions scenes;
  DataSetOptions set;
  std::string shard = "0/1";  ///< "I/N"
};

/// Makes the data set and writes what is there to --json. Throws ConfigError for a shard that is not I/N, and as
/// open_recipe and make_data_set.
void generate(GenerateOptions& options);

}  // namespace graupel::experiments
