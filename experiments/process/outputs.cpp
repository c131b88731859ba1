#include "experiments/process/outputs.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

namespace {

void check_writable(const fs::path& folder, const std::string& target) {
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw IoError("cannot write '" + target + "' (folder '" + folder.string() + "': " + std::strerror(errno) +
                  "). Choose a folder you may write to");
}

}  // namespace

void check_output_file(const std::string& file) {
  if (file.empty() || file == "-") return;
  std::error_code code;
  const fs::file_status status = fs::status(file, code);
  if (fs::is_directory(status)) throw IoError("cannot write '" + file + "' (it is a folder). Name a file");
  if (fs::exists(status) && !fs::is_regular_file(status)) return;
  const fs::path folder = fs::absolute(file).parent_path();
  if (!fs::is_directory(folder, code))
    throw IoError("cannot write '" + file + "' (there is no folder '" + folder.string() +
                  "'). Make it first, or name another");
  check_writable(folder, file);
}

void check_output_folder(const std::string& folder) {
  if (folder.empty()) return;
  make_folder(folder);
  check_writable(folder, folder);
}

}  // namespace graupel::experiments
