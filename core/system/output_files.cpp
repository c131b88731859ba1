#include "core/system/output_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/system/atomic_file.h"
#include "core/system/error.h"

namespace graupel {

namespace fs = std::filesystem;

namespace {

void check_writable(const fs::path& folder, const std::string& target) {
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw IoError("cannot write '" + target + "' (folder '" + folder.string() + "': " + std::strerror(errno) +
                  "). Choose a folder you may write to");
}

bool is_same_file(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty() || a == "-" || b == "-") return false;
  struct stat of_a {
  }, of_b{};
  const bool a_there = ::stat(a.c_str(), &of_a) == 0, b_there = ::stat(b.c_str(), &of_b) == 0;
  if (a_there && !S_ISREG(of_a.st_mode)) return false;
  if (a_there && b_there) return of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
  std::error_code of_path_a, of_path_b;
  const fs::path path_a = fs::weakly_canonical(fs::absolute(a), of_path_a),
                 path_b = fs::weakly_canonical(fs::absolute(b), of_path_b);
  if (of_path_a || of_path_b) return fs::absolute(a).lexically_normal() == fs::absolute(b).lexically_normal();
  return path_a == path_b;
}

/// A file has a longer name until it is finished (core/system/atomic_file.h).
void check_length(const std::string& file) {
  struct stat status {};
  if (::lstat((file + ".4194304-99999.part").c_str(), &status) == 0 || errno != ENAMETOOLONG) return;
  throw IoError("cannot write '" + file + "' (its name is too long, " +
                std::to_string(fs::path(file).filename().string().size()) +
                " bytes; until it is finished it has 19 more, and 255 are allowed). Choose a shorter name");
}

void check_folder(const std::string& target, const std::string& file) {
  const fs::path folder = fs::absolute(target).parent_path();
  std::error_code code;
  if (!fs::is_directory(folder, code))
    throw IoError("cannot write '" + file + "' (there is no folder '" + folder.string() +
                  "'). Make it first, or name another");
  check_writable(folder, file);
}

/// Of the folder of a path.
dev_t disk_of(const std::string& file) {
  struct stat status {};
  ::stat(fs::absolute(file).parent_path().c_str(), &status);
  return status.st_dev;
}

bool is_there(const std::string& file) {
  std::error_code code;
  return fs::exists(file, code);
}

/// A finished file is written as FILE.part before.
bool would_replace(const std::string& output, const std::string& other) {
  return is_same_file(output, other) || is_same_file(output + ".part", other);
}

[[noreturn]] void refuse(const NamedFile& output, const NamedFile& input) {
  throw ConfigError(output.name + " '" + output.file + "' would overwrite " + input.name + " '" + input.file +
                    "'. Give it another name");
}

}  // namespace

void check_output_file(const std::string& file) {
  if (file.empty() || file == "-") return;
  std::error_code code;
  const fs::file_status status = fs::status(file, code);
  if (fs::is_directory(status)) throw IoError("cannot write '" + file + "' (it is a folder). Name a file");
  if (fs::exists(status) && !fs::is_regular_file(status)) return;
  check_length(file);
  const LinkTarget target = follow_links(file);
  if (!target.open_file) check_folder(target.path, file);
}

void check_library_output(const std::string& file) {
  check_output_file(file);
  std::error_code code;
  const fs::file_status status = fs::status(file, code);
  const LinkTarget target = follow_links(file);
  if (file == "-" || target.open_file || (fs::exists(status) && !fs::is_regular_file(status)))
    throw IoError("cannot write to '" + file + "' (it is no regular file, as this format needs). Name a file");
  if (file.empty() || target.path == file) return;
  check_folder(file, file);
  if (disk_of(file) != disk_of(target.path))
    throw IoError("cannot write to '" + file + "' (it is a link to another disk, '" + target.path +
                  "', where a finished file cannot be moved). Name that file");
}

void check_output_folder(const std::string& folder) {
  if (folder.empty()) return;
  struct Made {
    std::vector<fs::path> folders;  ///< innermost first
    ~Made() {
      std::error_code code;
      for (const fs::path& one : folders) fs::remove(one, code);
    }
  } made;
  std::error_code code;
  for (fs::path path = fs::absolute(folder, code); !path.empty() && !is_there(path); path = path.parent_path())
    made.folders.push_back(path);
  make_folder(folder);
  check_writable(folder, folder);
}

void check_apart(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const NamedFile& output = outputs[k];
    if (output.file.empty()) continue;
    for (const NamedFile& input : inputs)
      if (is_there(input.file) && would_replace(output.file, input.file)) refuse(output, input);
    for (std::size_t j = 0; j < k; ++j)
      if (would_replace(output.file, outputs[j].file) || would_replace(outputs[j].file, output.file))
        throw ConfigError(output.name + " and " + outputs[j].name + " name the same file ('" + output.file +
                          "'). Give each its own");
  }
}

void check_apart_from_series(const std::vector<NamedFile>& inputs, const std::string& folder, const std::string& stem,
                             const std::vector<std::string>& endings) {
  for (const NamedFile& input : inputs) {
    if (input.file.empty()) continue;
    const fs::path file = input.file;
    const std::string name = file.filename();
    const bool ends =
        std::any_of(endings.begin(), endings.end(), [&](const std::string& ending) { return name.ends_with(ending); });
    if (!ends || !name.starts_with(stem)) continue;
    const std::string there = fs::path(folder) / name;
    if (is_same_file(there, input.file)) refuse({"the output", there}, input);
  }
}

}  // namespace graupel
