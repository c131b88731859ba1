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

bool is_same_file(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty() || a == "-" || b == "-") return false;
  std::error_code code;
  const fs::file_status status = fs::status(a, code);
  if (fs::exists(status) && !fs::is_regular_file(status)) return false;
  if (fs::exists(status) && fs::exists(b, code)) return fs::equivalent(a, b, code);
  return fs::weakly_canonical(fs::absolute(a), code) == fs::weakly_canonical(fs::absolute(b), code);
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

void check_trajectory_output(const std::string& file) {
  check_output_file(file);
  std::error_code code;
  const fs::file_status status = fs::status(file, code);
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw IoError("cannot write a trajectory to '" + file + "' (it is no regular file, as HDF5 needs). Name a file");
}

void check_apart(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const NamedFile& output = outputs[k];
    for (const NamedFile& input : inputs)
      if (is_same_file(output.file, input.file))
        throw ConfigError(output.name + " '" + output.file + "' would overwrite " + input.name + " '" + input.file +
                          "'. Give it another name");
    for (std::size_t j = 0; j < k; ++j)
      if (is_same_file(output.file, outputs[j].file))
        throw ConfigError(output.name + " and " + outputs[j].name + " name the same file ('" + output.file +
                          "'). Give each its own");
  }
}

void check_output_folder(const std::string& folder) {
  if (folder.empty()) return;
  make_folder(folder);
  check_writable(folder, folder);
}

}  // namespace graupel::experiments
