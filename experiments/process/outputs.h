// Where results go: checked before the work, so that hours of it are not lost to a mistyped folder.
#pragma once

#include <string>
#include <vector>

namespace graupel::experiments {

/// Throws IoError when `file` cannot be made: it is a folder, or its folder is missing or not writable. "" and "-" are
/// fine, and so is a target that is there and not a regular file (/dev/null, a pipe).
void check_output_file(const std::string& file);
/// The same for a trajectory, which HDF5 writes: also throws IoError for a device or a pipe.
void check_trajectory_output(const std::string& file);
/// A file and what named it: "--json", "the scene".
struct NamedFile {
  std::string name, file;
};
/// Throws ConfigError where an output is an input, by whatever path, or another output: what is there would be lost.
/// "", "-" and what is no regular file (/dev/null) are nothing that can be lost.
void check_apart(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);
/// Makes the folder and its parents; throws IoError when it cannot be made or written to. "" is fine.
void check_output_folder(const std::string& folder);

}  // namespace graupel::experiments
