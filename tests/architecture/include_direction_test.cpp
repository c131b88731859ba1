// The arrows of docs/architecture.md: what CMake declares is what the design allows, and no file includes against it.
#include <gtest/gtest.h>

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
    {"train", {"core", "io", "nn", "sparsegrid", "mpm", "graph", "rom"}},
    {"experiments", {"core", "io", "nn", "sparsegrid", "mpm", "validation", "graph", "compare", "rom"}},
    {"apps", {"core", "io", "nn", "sparsegrid", "mpm", "validation", "graph", "compare", "rom", "experiments"}},
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

TEST(Architecture, HeavyLibrariesStayBehindTheirFiles) {
  for (const auto& [module, depends] : allowed)
    for (const fs::path& file : sources_of(module)) {
      const std::string text = text_of(file);
      const std::string name = file.filename();
      if (text.find("#include <openvdb/") != std::string::npos) {
        EXPECT_TRUE((module == "sparsegrid" && name == "obstacle_vdb.cpp") ||
                    (module == "io" && name == "export_vdb.cpp"))
            << file << " includes OpenVDB";
      }
      if (text.find("#include <torch/") != std::string::npos || text.find("#include <ATen/") != std::string::npos) {
        EXPECT_EQ(module, "train") << file << " includes libtorch";
      }
      if (text.find("/distributed/c10d/") != std::string::npos) {
        EXPECT_TRUE(module == "train" && name == "comm_c10d.cpp") << file << " includes c10d";
      }
      if (text.find("__global__") != std::string::npos && file.extension() != ".cu" && file.extension() != ".cuh") {
        EXPECT_EQ(name, "parallel_for.h") << file << " launches kernels by itself";
      }
    }
}

}  // namespace
