// The side of the process that reads files of strangers (core/system/checks/file_check.h): graupel-check-hdf5 and
// graupel-check-vdb.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>

namespace graupel {

/// What the parent sends before the file's path, on the socket that is the child's standard input.
struct CheckRequest {
  uint64_t memory = 0;   ///< bytes that the process may take beside what it has
  uint32_t seconds = 0;  ///< of the processor
  uint32_t path_length = 0;
};
inline constexpr uint32_t longest_checked_path = 1 << 16;

/// What the child answers: a byte.
enum class CheckAnswer : char { passed = 'p', no_memory = 'm', cut = 'c', overflow = 'o' };
/// Exit codes of a child that ends in the middle.
inline constexpr int check_out_of_time = 124, check_parent_is_gone = 125, check_is_not_whole = 126;

/// The file ends in the middle of what it says that it holds, which the library does not notice.
struct FileIsCut : std::exception {};

/// The library writes or reads beyond its memory with this file, though it may not crash. No std::exception: libraries
/// catch these.
struct FileOverflows {};

/// This checker cannot tell whether the library comes through the file; the thorough one can.
struct FileIsUndecided : std::exception {};

/// Reads all of a file that a reader of Graupel may ask for, and changes nothing. Throws std::bad_alloc where the
/// library lacked memory, FileIsCut, FileOverflows and FileIsUndecided; what the library refuses by itself is no
/// matter.
using FileWalk = std::function<void(const std::string& path)>;

/// The main function of a checker: answers requests until its input ends. With files as arguments it checks these and
/// prints a line for each. From the first file on that its walk does not pass, the program `thorough` in its folder
/// takes the place of this one, if there is a name.
int run_checker(int argc, char** argv, const FileWalk& walk, const std::string& thorough = {});

}  // namespace graupel
