#include "io/trajectory/input_files.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr int deepest = 8;                    ///< level of a document at which files are named
constexpr std::uintmax_t largest = 64 << 20;  ///< document that is looked into [bytes]
constexpr int most_trajectories = 64;         ///< of a data set whose scenes are looked into

class FileList {
 public:
  void add(const std::string& name, const fs::path& path) {
    std::error_code code;
    const fs::file_status status = fs::status(path, code);
    if (fs::is_directory(status)) return add_folder(name, path);
    if (!fs::is_regular_file(status)) return;
    files_.push_back({name, path.string()});
    if (path.extension() == ".json") add_named_in_document(path);
    if (path.extension() == ".h5") add_named_in_trajectories(path.string());
  }
  void add_geometry(const std::string& file, const fs::path& folder) {
    files_.push_back({"the geometry", (folder / file).string()});
  }
  std::vector<NamedFile> take() { return std::move(files_); }

 private:
  void add_folder(const std::string& name, const fs::path& folder) {
    for (const std::string& inside : names_in(folder.string())) {
      std::error_code code;
      if (fs::is_regular_file(folder / inside, code)) add(name, folder / inside);
    }
  }
  void add_named_in_document(const fs::path& path) {
    std::error_code code;
    if (fs::file_size(path, code) > largest || code) return;
    look_into(read_file(path.string()), path.parent_path());
  }
  void add_named_in_trajectories(const std::string& path) {
    try {
      const TrajectoryReader reader(path);
      for (int i = 0; i < std::min(reader.count(), most_trajectories); ++i)
        look_into(reader.header(i).scene_json, fs::path(path).parent_path());
    } catch (const Error&) {  // who reads it says what is wrong with it
    }
  }
  void look_into(const std::string& text, const fs::path& folder) {
    visit(nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false, /*ignore_comments=*/true), folder, 0);
  }
  void visit(const nlohmann::json& value, const fs::path& folder, int level) {
    if (level > deepest || !value.is_structured()) return;
    for (const auto& [key, item] : value.items()) {
      if (item.is_string() && key == "file" && value.is_object()) add_geometry(item.get<std::string>(), folder);
      if (item.is_string() && key == "scene" && level == 0) add("the scene", folder / item.get<std::string>());
      visit(item, folder, level + 1);
    }
  }

  std::vector<NamedFile> files_;
};

bool is_there(const NamedFile& output) {
  std::error_code code;
  return !output.file.empty() && output.file != "-" &&
         (fs::is_regular_file(output.file, code) || fs::is_regular_file(output.file + ".part", code));
}

}  // namespace

std::vector<NamedFile> files_behind(const std::vector<NamedFile>& inputs, const std::vector<std::string>& set) {
  FileList list;
  for (const NamedFile& input : inputs) {
    if (input.file.empty()) continue;
    list.add(input.name, input.file);
    for (const std::string& change : set)
      if (const auto at = change.find("file="); at != std::string::npos)
        list.add_geometry(change.substr(at + 5), fs::path(input.file).parent_path());
  }
  return list.take();
}

void check_inputs_kept(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs,
                       const std::vector<std::string>& set) {
  const bool any = std::any_of(outputs.begin(), outputs.end(), is_there);  // else nothing can be lost
  check_apart(any ? files_behind(inputs, set) : std::vector<NamedFile>(), outputs);
}

}  // namespace graupel::io
