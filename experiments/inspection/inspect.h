// graupel inspect: the content of files, and the curves of training runs.
#pragma once

#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

struct InspectOptions {
  CommonOptions common;
  std::vector<std::string> files;
  std::string plots, output;  ///< output: of what is recovered
  bool recover = false;
};

/// Prints what is in a file, or the curves of training runs, or recovers a trajectory; writes the same to --json and
/// the plots to --plots. Throws ConfigError for files and flags that do not fit together, InputError for damaged files.
void inspect(InspectOptions& options);

}  // namespace graupel::experiments
