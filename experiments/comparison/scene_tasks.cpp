#include "experiments/comparison/scene_tasks.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "core/system/error.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

namespace {

SceneTask read_scene_file(const std::string& path, const CompareOptions& options) {
  SceneTask task;
  task.scene = io::read_scene(path, options.set);
  if (task.scene.name.empty()) task.scene.name = fs::path(path).stem();
  task.source = path;
  task.seed = options.seed.value_or(task.scene.seed);
  task.frames = options.frames > 0 ? options.frames : task.scene.frames;
  return task;
}

std::vector<SceneTask> read_data_set(const std::string& path, const CompareOptions& options) {
  if (!options.set.empty())
    throw ConfigError("--set cannot change the scenes of a data set ('" + path +
                      "'). Leave it out, or name scene files");
  const io::TrajectoryReader reader(path);
  std::vector<SceneTask> tasks;
  for (int i = 0; i < reader.count(); ++i) {
    Trajectory trajectory = reader.header(i);
    const std::string source = reader.count() > 1 ? fmt::format("{}#{}", path, i) : path;
    if (trajectory.scene_json.empty())
      throw InputError("'" + source +
                       "' holds no scene, so its walls and obstacles are unknown. Use a data set made by graupel");
    SceneTask task;
    task.scene = io::parse_stored_scene(trajectory.scene_json, source, path);
    task.scene.name = fmt::format("{}#{}", fs::path(path).stem().string(), i);
    task.source = source;
    task.seed = trajectory.seed;
    const int64_t stored = static_cast<int64_t>(trajectory.frames.size()) - 1;
    if (options.frames > stored)
      throw ConfigError(
          fmt::format("--frames {} is more than '{}' holds (allowed: 1 to {}). Ask for fewer, or name "
                      "the scene file",
                      options.frames, source, stored));
    task.frames = options.frames > 0 ? options.frames : stored;
    trajectory.frames = reader.frames(i, 0, task.frames + 1);
    task.initial_velocity = reader.initial_velocity(i);
    if (task.initial_velocity.empty()) task.initial_velocity = trajectory.frames.front().velocity;
    if (task.initial_velocity.empty())
      throw InputError("'" + source + "' stores no velocity of the first frame. Use a data set made by graupel");
    for (ParticleFrame& frame : trajectory.frames) std::vector<Vec3f>().swap(frame.velocity);
    task.stored = std::move(trajectory);
    tasks.push_back(std::move(task));
  }
  return tasks;
}

std::vector<std::string> expand_folders(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> inside;
    for (const auto& entry : fs::directory_iterator(path))
      if (entry.path().extension() == ".json") inside.push_back(entry.path());
    if (inside.empty()) throw ConfigError("no scene (*.json) in folder '" + path + "'. Name another with --scenes");
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

/// Names are file names of pictures and keys of rows.
void check_names_differ(const std::vector<SceneTask>& tasks) {
  std::map<std::string, std::string> source_of;
  for (const SceneTask& task : tasks) {
    const auto [found, added] = source_of.emplace(task.scene.name, task.source);
    if (!added)
      throw ConfigError(fmt::format("'{}' and '{}' are both named '{}'. Change \"name\" in one, or compare them apart",
                                    found->second, task.source, task.scene.name));
  }
}

}  // namespace

std::vector<SceneTask> read_scene_tasks(const CompareOptions& options) {
  std::vector<SceneTask> tasks;
  for (const std::string& path : expand_folders(options.scenes)) {
    if (path.ends_with(".h5")) {
      for (SceneTask& task : read_data_set(path, options)) tasks.push_back(std::move(task));
    } else {
      tasks.push_back(read_scene_file(path, options));
    }
    if (tasks.back().frames < 1)
      throw ConfigError("'" + path + "' has no frame after the first. Give --frames 1 or more");
  }
  check_names_differ(tasks);
  if (tasks.empty()) throw ConfigError("compare needs at least one scene. Example: --scenes scenes/shared");
  return tasks;
}

}  // namespace graupel::experiments
