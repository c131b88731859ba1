#include "tests/fuzz/fuzz_target.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace graupel::fuzz {

namespace {

/// A folder that goes with the process.
struct Folder {
  Folder() : path(std::filesystem::temp_directory_path() / ("graupel_fuzz_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path);
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::filesystem::path path;
};

}  // namespace

std::string file_with(const std::string& bytes, const std::string& name) {
  static const Folder folder;
  const std::string path = (folder.path / name).string();
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw std::runtime_error("cannot write " + path);
  return path;
}

void expect(bool condition, const char* what) {
  if (!condition) throw std::logic_error(what);
}

}  // namespace graupel::fuzz
