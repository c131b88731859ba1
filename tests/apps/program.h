// Starts the program under test and keeps what it printed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

namespace graupel::test {

struct Outcome {
  int exit_code = -1;
  std::string output;  ///< standard output and error

  bool says(const std::string& text) const { return output.find(text) != std::string::npos; }
};

/// Runs this file with these arguments (a shell line) in the repository's root.
inline Outcome run_program(const std::string& file, const std::string& arguments) {
  const std::string line = "cd '" GRAUPEL_SOURCE_DIR "' && '" + file + "' " + arguments + " 2>&1";
  Outcome outcome;
  std::FILE* pipe = ::popen(line.c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

/// The same for build/graupel.
inline Outcome graupel(const std::string& arguments) { return run_program(GRAUPEL_BINARY_DIR "/graupel", arguments); }

/// Whether graupel-train, which needs libtorch, is there.
inline bool training_is_built() { return std::filesystem::exists(GRAUPEL_BINARY_DIR "/graupel-train"); }

/// A folder that is removed with the test.
class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "graupel_test_XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return file(name);
  }

 private:
  std::filesystem::path path_;
};

/// A small scene: one cube of water above the floor, and what `extra` adds at the top level.
inline std::string small_scene(const std::string& extra = "", const std::string& source = "") {
  return "{\n"
         "  \"name\": \"small\",\n"
         "  \"domain\": { \"dx\": 0.03125 },\n"
         "  \"materials\": { \"water\": { \"preset\": \"taichi_water\" } },\n"
         "  \"sources\": [" +
         (source.empty() ? std::string("{ \"shape\": \"box\", \"size\": [0.15, 0.15, 0.15], \"position\": [0.5, 0.5, "
                                       "0.5], \"material\": \"water\" }")
                         : source) +
         "],\n"
         "  \"frames\": 12" +
         (extra.empty() ? "" : ",\n" + extra) + "\n}\n";
}

}  // namespace graupel::test
