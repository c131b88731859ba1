#include "experiments/process/input_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/system/error.h"

namespace graupel::experiments {

bool is_there(const std::string& path) {
  std::error_code unknown;
  return std::filesystem::exists(path, unknown);
}

bool is_folder(const std::string& path) {
  std::error_code unknown;
  return std::filesystem::is_directory(path, unknown);
}

void check_readable(const std::string& path) {
  if (::faccessat(AT_FDCWD, path.c_str(), R_OK, AT_EACCESS) == 0) return;
  const int reason = errno;
  if (reason == ENOENT || reason == ENOTDIR) throw InputError("'" + path + "' is not there. Correct the name");
  throw InputError("cannot read '" + path + "' (" + std::strerror(reason) + "). " +
                   (reason == EACCES ? "Have its owner allow you to read it" : "Correct the name"));
}

}  // namespace graupel::experiments
