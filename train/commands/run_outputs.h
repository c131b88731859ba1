// What a training command writes, checked before the work.
#pragma once

#include <string>
#include <vector>

#include "core/system/output_files.h"

namespace graupel::train {

/// Throws ConfigError where `data`, the folder of a data set, is a file.
void check_data_folder(const std::string& data);

/// Throws IoError where `json` or the run folder (each may be "") cannot be written, ConfigError where a file of theirs
/// would take the place of an input, of what that names, or of each other (io::check_inputs_kept()), and where the run
/// folder is an input.
void check_run_outputs(const std::vector<NamedFile>& inputs, const std::string& run, const std::string& json);

}  // namespace graupel::train
