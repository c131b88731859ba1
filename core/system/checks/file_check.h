// Files of strangers in HDF5 and OpenVDB: another process reads them first, by the same library. Where that crashes,
// hangs or takes more memory than a file of that size justifies, the process ends and this one goes on.
#pragma once

#include <string>

namespace graupel {

enum class FileFormat { hdf5, vdb };

/// Throws InputError where `path` is no regular file, or where the library did not come through it; what the library
/// refuses by itself is left to the reader. A file that passed is not read again until its size or time changes. After
/// Ctrl-C or SIGTERM throws StoppedError. Where there is no checker the file is not checked; ConfigError where the
/// folder that GRAUPEL_CHECKERS names has none.
void check_file(const std::string& path, FileFormat format);

/// Path of the program that checks this format: graupel-check-hdf5 or graupel-check-vdb in the folder that
/// GRAUPEL_CHECKERS names; else beside this program, in ../libexec/graupel or bin from there or from this library, or
/// where the program 'graupel' of PATH has it. Empty when it is not there.
std::string checker_of(FileFormat format);

/// Whether files are read unchecked, since GRAUPEL_CHECKERS=none says so.
bool checks_are_off();

}  // namespace graupel
