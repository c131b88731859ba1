// Where models and scenes are: in a checkout, or where they were installed beside the program.
#pragma once

#include <filesystem>
#include <string>
#include <system_error>

namespace graupel {

/// `path` ("models", "scenes/recipes/general.json"), where it is there, seen from here; else ../share/graupel/`path`
/// beside the program, or that of the sources above a build folder, where that is there; else `path`.
inline std::string or_installed(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code none;  // what cannot be looked at is not there; who reads `path` says why
  if (fs::exists(path, none)) return path;
  const fs::path beside = fs::read_symlink("/proc/self/exe", none).parent_path();
  for (const fs::path& place : {beside / "../share/graupel", beside / ".."})
    if (const fs::path there = (place / path).lexically_normal(); fs::exists(there, none)) return there.string();
  return path;
}

}  // namespace graupel
