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
  std::string shard = "0/1";  ///< "I/N" or "slurm"
  bool shard_given = false;
  int slurm_tasks = 0;  ///< print a script for a Slurm array of so many tasks instead; 0: make the set
};

/// Makes the data set and writes what is there to --json, or prints the script that lets Slurm do so. Throws as
/// parse_shard, open_recipe and make_data_set.
void generate(GenerateOptions& options);

}  // namespace graupel::experiments
