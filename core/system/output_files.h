// Where results go: checked before the work, so that hours of it are not lost to a mistyped folder, and no file that a
// run reads is lost to one that it writes.
#pragma once

#include <string>
#include <vector>

namespace graupel {

/// Throws IoError when `file` cannot be made: it is a folder, or its folder is missing or not writable. "" and "-" are
/// fine, and so is a target that is there and not a regular file (/dev/null, a pipe).
void check_output_file(const std::string& file);
/// The same for what a library writes by itself (HDF5, OpenVDB): also throws IoError for a device or a pipe, which the
/// finished file would replace, and for "-".
void check_library_output(const std::string& file);
/// Throws IoError when the folder or its parents cannot be made or written to; what it makes for that is removed again.
/// "" is fine.
void check_output_folder(const std::string& folder);

/// A file and what named it: "--json", "the scene".
struct NamedFile {
  std::string name, file;
};
/// Throws ConfigError where an output is an input or another output, by whatever path or link (device and inode): what
/// is there would be lost. An output's FILE.part counts as it does. "", "-" and what is no regular file (/dev/null) are
/// nothing that can be lost.
void check_apart(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);
/// The same for a numbered series of files in `folder`, whose names begin with `stem` and end with one of `endings`.
void check_apart_from_series(const std::vector<NamedFile>& inputs, const std::string& folder, const std::string& stem,
                             const std::vector<std::string>& endings);

}  // namespace graupel
