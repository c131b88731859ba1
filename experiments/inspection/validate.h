// What is wrong with files, all at once: graupel validate.
#pragma once

#include <string>
#include <vector>

#include "experiments/process/common_options.h"

namespace graupel::experiments {

/// The texts of all that is wrong with a scene, recipe, sweep, trajectory, data set, saved state, weights or .vdb file,
/// each with the file's name; empty where nothing is. A scene's or recipe's keys are all read, and so is every split of
/// a data set; a file of another kind up to its first error.
std::vector<std::string> mistakes_in(const std::string& file);

struct ValidateOptions {
  std::vector<std::string> files;
  CommonOptions common;
};

/// Prints the mistakes of all files, or "FILE: ok". Throws InputError where there is one, after all are printed.
void validate(ValidateOptions& options);

}  // namespace graupel::experiments
