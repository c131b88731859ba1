// What a run reads, file by file, so that no output of it takes the place of one.
#pragma once

#include <string>
#include <vector>

#include "core/system/output_files.h"

namespace graupel::io {

/// Throws as check_apart(). Inputs are files, or folders with all that is in them; of scenes, recipes and trajectories
/// also the geometry and the scenes that they name, with the changes `set` ("obstacles.0.file=bowl.obj").
void check_inputs_kept(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs,
                       const std::vector<std::string>& set = {});

/// The files behind `inputs`, as above: themselves, and what they name.
std::vector<NamedFile> files_behind(const std::vector<NamedFile>& inputs, const std::vector<std::string>& set = {});

}  // namespace graupel::io
