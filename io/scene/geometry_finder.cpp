#include "io/scene/geometry_finder.h"

#include <filesystem>
#include <vector>

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr int levels_above = 3;  ///< folders above the trajectory's that are searched

/// The ends of a path, longest first, without the whole path: b/c/d.obj, c/d.obj, d.obj.
std::vector<fs::path> ends_of(const fs::path& path) {
  std::vector<fs::path> ends;
  const fs::path relative = path.relative_path();
  for (auto first = relative.begin(); first != relative.end(); ++first) {
    fs::path end;
    for (auto part = first; part != relative.end(); ++part) end /= *part;
    ends.push_back(end);
  }
  return ends;
}

}  // namespace

std::string SceneFolder::find(const std::string& given) const {
  return fs::absolute(fs::path(folder_) / given).lexically_normal().string();
}

std::string SceneFolder::remedy(const std::string&) const {
  return "Paths are relative to the scene file; correct the path or add the file";
}

/// Longer ends and nearer folders come first. Above the trajectory's folder a bare name would be too weak a clue.
std::string AroundTrajectory::find(const std::string& given) const {
  const fs::path stored = fs::absolute(given).lexically_normal();
  std::error_code unreadable;
  if (fs::is_regular_file(stored, unreadable)) return stored.string();
  const fs::path folder = fs::absolute(file_).lexically_normal().parent_path();
  for (const fs::path& end : ends_of(stored)) {
    fs::path from = folder;
    for (int level = 0; level <= levels_above; ++level, from = from.parent_path()) {
      if (level > 0 && !end.has_parent_path()) break;
      if (fs::is_regular_file(from / end, unreadable)) return (from / end).string();
    }
  }
  return stored.string();
}

std::string AroundTrajectory::remedy(const std::string& given) const {
  return "The scene is stored in '" + file_ + "'; put '" + fs::path(given).filename().string() +
         "' beside that file or back to its old place";
}

}  // namespace graupel::io
