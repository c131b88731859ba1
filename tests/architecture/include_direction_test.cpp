// The arrows of docs/architecture.md: what CMake declares is what the design allows, and no file includes against it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Graph = std::map<std::string, std::set<std::string>>;

// The design's arrows, closed under transitivity by hand.
const Graph allowed = {
    {"core", {}},
    {"io", {"core"}},
    {"nn", {"core"}},
    {"sparsegrid", {"core"}},
    {"mpm", {"core", "sparsegrid"}},
    {"validation", {"core", "sparsegrid", "mpm"}},
    {"graph", {"core", "nn", "sparsegrid"}},
    {"compare", {"core", "io", "sparsegrid"}},
    {"rom", {"core", "nn", "sparsegrid", "mpm"}},
    {"hybrid", {"core", "nn", "sparsegrid", "mpm"}},
    {"train", {"core", "io", "nn", "sparsegrid", "mpm", "graph", "rom", "hybrid"}},
    {"experiments", {"core", "io", "nn", "sparsegrid", "mpm", "graph", "compare", "rom", "hybrid"}},
    {"library", {"core", "io", "nn", "mpm", "graph", "rom", "experiments"}},
    {"apps", {"core", "io", "nn", "mpm", "experiments"}},
    {"bench",
     {"core", "io", "nn", "sparsegrid", "mpm", "validation", "graph", "compare", "rom", "hybrid", "experiments"}},
};

std::string text_of(const fs::path& path) {
  std::ifstream stream(path);
  std::stringstream buffer;
  buffer << stream.rdbuf();
  return buffer.str();
}

std::vector<fs::path> sources_of(const std::string& folder) {
  std::vector<fs::path> files;
  const fs::path root = fs::path(GRAUPEL_SOURCE_DIR) / folder;
  if (!fs::exists(root)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    const std::string ending = entry.path().extension();
    if (ending == ".h" || ending == ".cpp" || ending == ".cu" || ending == ".cuh") files.push_back(entry.path());
  }
  return files;
}

TEST(Architecture, CMakeDeclaresOnlyTheDesignsArrows) {
  std::ifstream stream(GRAUPEL_DEPENDENCIES);
  std::string line;
  int modules = 0;
  while (std::getline(stream, line)) {
    const auto colon = line.find(':');
    const std::string module = line.substr(0, colon);
    ASSERT_TRUE(allowed.count(module)) << module;
    std::istringstream words(line.substr(colon + 1));
    for (std::string word; words >> word;) EXPECT_TRUE(allowed.at(module).count(word)) << module << " -> " << word;
    ++modules;
  }
  EXPECT_EQ(modules, static_cast<int>(allowed.size()));
}

TEST(Architecture, NoIncludeAgainstTheArrows) {
  const std::regex include("^\\s*#\\s*include\\s+\"([a-z]+)/");
  int checked = 0;
  for (const auto& [module, depends] : allowed)
    for (const fs::path& file : sources_of(module)) {
      std::istringstream lines(text_of(file));
      for (std::string line; std::getline(lines, line);) {
        std::smatch match;
        if (!std::regex_search(line, match, include)) continue;
        const std::string target = match[1];
        ++checked;
        EXPECT_TRUE(target == module || depends.count(target)) << file << ": " << line;
      }
    }
  EXPECT_GT(checked, 100);
}

/// Arrows between the sub-folders of a module, as its CMakeLists.txt declares them: folder -> what it may include.
/// "headers" are the public headers in the module's folder itself; its sources there may include all.
std::map<std::string, Graph> declared_folders() {
  std::map<std::string, Graph> modules;
  std::ifstream stream(GRAUPEL_FOLDERS);
  for (std::string line; std::getline(stream, line);) {
    const auto space = line.find(' '), colon = line.find(':');
    std::set<std::string>& allowed_folders = modules[line.substr(0, space)][line.substr(space + 1, colon - space - 1)];
    std::istringstream words(line.substr(colon + 1));
    for (std::string word; words >> word;) allowed_folders.insert(word);
  }
  return modules;
}

/// The declared folder that a file of a module belongs to; "" for a source in the module's folder itself.
std::string folder_of(const fs::path& file_in_module, const Graph& folders) {
  for (fs::path folder = file_in_module.parent_path(); !folder.empty(); folder = folder.parent_path())
    if (folders.count(folder.string())) return folder.string();
  if (file_in_module.has_parent_path()) return "undeclared " + file_in_module.parent_path().string();
  return file_in_module.extension() == ".h" ? "headers" : "";
}

TEST(Architecture, SubFoldersIncludeWhatTheyDeclare) {
  const std::regex include("^\\s*#\\s*include\\s+\"([a-z]+)/([^\"]+)\"");
  const auto modules = declared_folders();
  EXPECT_GE(modules.size(), 7u);
  for (const auto& [module, folders] : modules)
    for (const fs::path& file : sources_of(module)) {
      const std::string from = folder_of(fs::relative(file, fs::path(GRAUPEL_SOURCE_DIR) / module), folders);
      if (from.empty()) continue;
      ASSERT_TRUE(folders.count(from)) << file << ": " << from << " (declare it in " << module << "/CMakeLists.txt)";
      std::istringstream lines(text_of(file));
      for (std::string line; std::getline(lines, line);) {
        std::smatch match;
        if (!std::regex_search(line, match, include) || match[1] != module) continue;
        const std::string to = folder_of(fs::path(match[2].str()), folders);
        EXPECT_TRUE(to == from || folders.at(from).count(to)) << file << ": " << line;
      }
    }
}

TEST(Architecture, NoArrowBetweenSubFoldersRunsBack) {
  for (const auto& [module, folders] : declared_folders()) {
    std::set<std::string> placed;
    for (bool grows = true; grows;) {
      grows = false;
      for (const auto& [folder, depends] : folders)
        if (!placed.count(folder) && std::includes(placed.begin(), placed.end(), depends.begin(), depends.end()))
          grows = placed.insert(folder).second;
    }
    for (const auto& [folder, depends] : folders)
      EXPECT_TRUE(placed.count(folder)) << module << "/" << folder << " includes what includes it";
  }
}

TEST(Architecture, AFolderHoldsAtMostThirtyFiles) {
  std::map<fs::path, int> count;
  for (const auto& [module, depends] : allowed)
    for (const fs::path& file : sources_of(module)) ++count[file.parent_path()];
  for (const fs::path& file : sources_of("tests")) ++count[file.parent_path()];
  for (const auto& [folder, files] : count) EXPECT_LE(files, 30) << folder;
}

TEST(Architecture, FewSourcesAskWhetherThereIsCuda) {
  std::vector<fs::path> asking;
  for (const auto& [module, depends] : allowed)
    for (const fs::path& file : sources_of(module))
      if (text_of(file).find("GRAUPEL_HAVE_CUDA") != std::string::npos) asking.push_back(file);
  EXPECT_LE(asking.size(), 5u) << ::testing::PrintToString(asking);
}

TEST(Architecture, HeavyLibrariesStayBehindTheirFiles) {
  for (const auto& [module, depends] : allowed)
    for (const fs::path& file : sources_of(module)) {
      const std::string text = text_of(file);
      const std::string name = file.filename();
      if (text.find("#include <openvdb/") != std::string::npos) {
        EXPECT_TRUE((module == "sparsegrid" && file.parent_path().filename() == "vdb") ||
                    (module == "io" && (name == "export_vdb.cpp" || name == "particle_surface.cpp")))
            << file << " includes OpenVDB";
      }
      if (text.find("#include <torch/") != std::string::npos || text.find("#include <ATen/") != std::string::npos) {
        EXPECT_EQ(module, "train") << file << " includes libtorch";
      }
      if (text.find("#include <CLI/") != std::string::npos) {
        EXPECT_TRUE(module == "core" && name == "command_line.cpp") << file << " includes CLI11";
      }
      if (text.find("/distributed/c10d/") != std::string::npos) {
        EXPECT_TRUE(module == "train" && name == "comm_c10d.cpp") << file << " includes c10d";
      }
      if (text.find("__global__") != std::string::npos && file.extension() != ".cu" && file.extension() != ".cuh") {
        EXPECT_EQ(name, "parallel_for.h") << file << " launches kernels by itself";
      }
    }
}

TEST(Architecture, VerbsAreShort) {
  for (const fs::path& file : sources_of("apps")) {
    const std::string text = text_of(file);
    EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 120) << file << ": what a verb does belongs to experiments/";
    EXPECT_EQ(text.find("nlohmann/json.hpp"), std::string::npos) << file;
  }
}

}  // namespace
