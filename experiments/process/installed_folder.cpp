#include "experiments/process/installed_folder.h"

#include <filesystem>

namespace graupel::experiments {

namespace fs = std::filesystem;

std::string or_installed(const std::string& folder) {
  if (fs::exists(folder)) return folder;
  const fs::path beside = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& place : {beside / "../share/graupel", beside / ".."})
    if (const fs::path there = (place / folder).lexically_normal(); fs::exists(there)) return there.string();
  return folder;
}

}  // namespace graupel::experiments
