#include "experiments/process/installed_folder.h"

#include <filesystem>

namespace graupel::experiments {

namespace fs = std::filesystem;

std::string or_installed(const std::string& folder) {
  const fs::path program = fs::read_symlink("/proc/self/exe");
  const fs::path installed = (program.parent_path() / "../share/graupel" / folder).lexically_normal();
  return !fs::exists(folder) && fs::exists(installed) ? installed.string() : folder;
}

}  // namespace graupel::experiments
