// Where results go: checked before the work, so that hours of it are not lost to a mistyped folder.
#pragma once

#include <string>

namespace graupel::experiments {

/// Throws IoError when `file` cannot be made: it is a folder, or its folder is missing or not writable. "" and "-" are
/// fine, and so is a target that is there and not a regular file (/dev/null, a pipe).
void check_output_file(const std::string& file);
/// Makes the folder and its parents; throws IoError when it cannot be made or written to. "" is fine.
void check_output_folder(const std::string& folder);

}  // namespace graupel::experiments
