#include "experiments/process/python_tool.h"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "core/system/error.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

namespace {

std::vector<fs::path> tool_folders() {
  const fs::path program = fs::read_symlink("/proc/self/exe");
  if (const char* chosen = std::getenv("GRAUPEL_TOOLS")) return {chosen};
  return {program.parent_path() / "tools", program.parent_path() / "../share/graupel/tools", GRAUPEL_TOOLS_SOURCE};
}

std::string tool_file(const std::string& name) {
  if (const std::optional<std::string> found = find_python_tool(name)) return *found;
  std::string tried;
  for (const fs::path& folder : tool_folders())
    tried += (tried.empty() ? "'" : ", '") + folder.lexically_normal().string() + "'";
  throw ConfigError("the tool '" + name + "' is not there (looked for in " + tried +
                    "). Set GRAUPEL_TOOLS to the folder tools/ of Graupel's sources");
}

}  // namespace

std::optional<std::string> find_python_tool(const std::string& name) {
  for (const fs::path& folder : tool_folders())
    if (fs::is_regular_file(folder / name)) return (folder / name).lexically_normal().string();
  return std::nullopt;
}

void become_python_tool(const std::string& name, const std::vector<std::string>& arguments) {
  const fs::path program = fs::read_symlink("/proc/self/exe");
  std::vector<std::string> words = {tool_file(name)};
  words.insert(words.end(), arguments.begin(), arguments.end());
  ::setenv("GRAUPEL_PROGRAM", program.c_str(), 1);
  execute("python3", words);
  throw ConfigError("cannot start python3, which '" + name + "' runs on (" + std::strerror(errno) +
                    "). Install python3, python3-numpy and python3-h5py");
}

}  // namespace graupel::experiments
