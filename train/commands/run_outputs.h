// What a training command writes, checked before the work.
#pragma once

#include <string>
#include <vector>

#include "core/system/output_files.h"

namespace graupel::train {

/// Throws IoError where `json` cannot be written, ConfigError where it or a file of the run folder (each may be "")
/// would take the place of an input, of what that names, or of each other (io::check_inputs_kept()).
void check_run_outputs(const std::vector<NamedFile>& inputs, const std::string& run, const std::string& json);

}  // namespace graupel::train
