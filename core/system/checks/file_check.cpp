#include "core/system/checks/file_check.h"

#include <dlfcn.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <set>
#include <tuple>
#include <vector>

#include "core/system/checks/checker_process.h"
#include "core/system/error.h"

namespace graupel {

namespace {

namespace fs = std::filesystem;

/// What a library may take to read a file: a part for any file, and a part for each of its bytes.
struct Allowance {
  const char* program;
  const char* library;
  uint64_t memory, memory_per_byte;
  double seconds, seconds_per_byte;

  CheckRequest request(uint64_t file_bytes) const {
    return {.memory = memory + memory_per_byte * file_bytes,
            .seconds = static_cast<uint32_t>(seconds + seconds_per_byte * static_cast<double>(file_bytes)),
            .path_length = 0};
  }
};

/// HDF5: all but the values is read, of these little. OpenVDB: all is read. A node of 8 KB in a file may have 266 KB in
/// memory.
constexpr Allowance allowance_of[] = {
    {"graupel-check-hdf5", "the HDF5 library", uint64_t(256) << 20, 4, 3, 2e-8},
    {"graupel-check-vdb", "the OpenVDB library", uint64_t(256) << 20, 48, 4, 1e-7},
};

const Allowance& allowance(FileFormat format) { return allowance_of[static_cast<int>(format)]; }

/// A file as it was when it passed.
using Passed = std::tuple<FileFormat, dev_t, ino_t, off_t, time_t, long>;

Passed identity(FileFormat format, const struct stat& status) {
  return {format, status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

/// Folders where checkers may be, the likeliest first.
std::vector<fs::path> folders() {
  std::vector<fs::path> found;
  const auto around = [&](const fs::path& folder) {
    for (const char* beside : {".", "../libexec/graupel", "../../libexec/graupel", "bin"})
      found.push_back((folder / beside).lexically_normal());
  };
  std::error_code code;
  around(fs::read_symlink("/proc/self/exe", code).parent_path());
  Dl_info library{};
  if (::dladdr(reinterpret_cast<const void*>(&allowance_of), &library) != 0 && library.dli_fname != nullptr)
    around(fs::absolute(library.dli_fname, code).parent_path());
  const char* const variable = std::getenv("PATH");
  const std::string path = variable == nullptr ? "" : variable;
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    const fs::path folder = path.substr(begin, end - begin);
    if (folder.is_absolute() && ::access((folder / "graupel").c_str(), X_OK) == 0) around(folder);
    begin = end + 1;
  }
  return found;
}

/// The folder that the environment names; null for none.
const char* named_folder() {
  const char* const folder = std::getenv("GRAUPEL_CHECKERS");
  return folder == nullptr || *folder == '\0' ? nullptr : folder;
}

/// Empty where there is none: a program of its own that links the library need not bring one.
std::string existing_checker(FileFormat format) {
  std::string checker = checker_of(format);
  if (checker.empty() && named_folder() != nullptr)
    throw ConfigError("GRAUPEL_CHECKERS names a folder without the program '" + std::string(allowance(format).program) +
                      "', which checks files before they are read (" + named_folder() +
                      "). Name the folder that has it, or none: files are read unchecked then");
  return checker;
}

[[noreturn]] void refuse(const std::string& path, FileFormat format, const std::string& what) {
  throw InputError("cannot read '" + path + "' (" + allowance(format).library + " " + what +
                   "). The file is damaged or was made to do harm; make it again or choose another");
}

/// The processes of this one that check files, one a format, and what passed.
struct Checks {
  std::mutex mutex;
  std::set<Passed> passed;
  CheckerProcess process[2];
};

/// Never destroyed: files may be read until the very end.
Checks& checks() {
  static Checks& all = *new Checks;
  return all;
}

}  // namespace

bool checks_are_off() {
  const char* const folder = named_folder();
  return folder != nullptr && std::string(folder) == "none";
}

std::string checker_of(FileFormat format) {
  const auto in = [&](const fs::path& folder) { return (folder / allowance(format).program).string(); };
  if (const char* const folder = named_folder())
    return ::access(in(folder).c_str(), X_OK) == 0 ? in(folder) : std::string();
  for (const fs::path& folder : folders())
    if (::access(in(folder).c_str(), X_OK) == 0) return in(folder);
  return {};
}

void check_file(const std::string& path, FileFormat format) {
  struct stat status {};
  if (checks_are_off() || ::stat(path.c_str(), &status) != 0) return;  // the reader says that it is not there
  if (!S_ISREG(status.st_mode))
    throw InputError("cannot read '" + path + "' (it is a folder, a pipe or a device). Give a regular file");
  Checks& all = checks();
  const std::lock_guard lock(all.mutex);
  const Passed file = identity(format, status);
  if (all.passed.count(file) > 0) return;
  const std::string checker = existing_checker(format);
  if (checker.empty()) return;
  const CheckRequest request = allowance(format).request(static_cast<uint64_t>(status.st_size));
  const std::string trouble =
      all.process[static_cast<int>(format)].check(checker, fs::absolute(path).string(), request);
  if (!trouble.empty()) refuse(path, format, trouble);
  all.passed.insert(file);
}

}  // namespace graupel
