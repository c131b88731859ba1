#include "experiments/comparison/scene_tasks.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "core/scene/checks/frame_time_check.h"
#include "core/scene/recipes/category_recipe.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "experiments/data/scene_source.h"
#include "experiments/data/stored_frames.h"
#include "experiments/process/file_name.h"
#include "experiments/process/input_file.h"
#include "io/scene/scene_reader.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

namespace fs = std::filesystem;

namespace {

/// What a recipe of categories says in a scene's name; empty for other scenes.
std::string category_of(const std::string& name) {
  for (const auto& [word, category] : EnumWords<SceneCategory>::words)
    if (name.ends_with(std::string("-") + word)) return word;
  return "";
}

SceneTask read_scene_file(const std::string& path, const CompareOptions& options) {
  SceneTask task;
  task.scene = io::read_scene(path, options.set);
  if (task.scene.name.empty()) task.scene.name = fs::path(path).stem();
  task.source = path;
  task.category = category_of(task.scene.name);
  task.seed = options.seed.value_or(task.scene.seed);
  task.frames = options.frames > 0 ? options.frames : task.scene.frames;
  return task;
}

/// Which scenes of a recipe or data set --scenes asks for: first <= i < end, to the last one where end is 0.
struct SceneRange {
  int64_t first = 0, end = 0;
  std::string word;  ///< as it was written: "8" or "8:16"; empty without a wish
};

/// The same with the number of scenes there are. Throws ConfigError for more.
SceneRange range_within(SceneRange wanted, int64_t there, const std::string& what) {
  if (wanted.end > there)
    throw ConfigError(
        fmt::format("--scenes {} is more than {} holds (allowed: 1 to {}, or FIRST:END up to {}). Ask for fewer",
                    wanted.word, what, there, there));
  if (wanted.end == 0) wanted.end = there;
  return wanted;
}

std::vector<SceneTask> read_data_set(const std::string& path, const SceneRange& wanted, const CompareOptions& options) {
  if (!options.set.empty())
    throw ConfigError("--set cannot change the scenes of a data set ('" + path +
                      "'). Leave it out, or name scene files");
  check_readable(path);
  const io::TrajectoryReader reader(path);
  std::vector<SceneTask> tasks;
  const SceneRange range = range_within(wanted, reader.count(), "'" + path + "'");
  for (auto i = static_cast<int>(range.first); i < range.end; ++i) {
    Trajectory trajectory = reader.header(i);
    const std::string source = reader.count() > 1 ? fmt::format("{}#{}", path, i) : path;
    if (trajectory.scene_json.empty())
      throw InputError("'" + source +
                       "' holds no scene, so its walls and obstacles are unknown. Use a data set made by graupel");
    SceneTask task;
    task.scene = io::parse_stored_scene(trajectory.scene_json, source, path);
    check_frame_time(trajectory.frame_time, task.scene.frame_time, "'" + source + "'");
    task.category = category_of(task.scene.name);
    task.scene.name = fmt::format("{}#{}", fs::path(path).stem().string(), i);
    task.source = source;
    task.seed = trajectory.seed;
    const int64_t stored = static_cast<int64_t>(trajectory.frames.size()) - 1;
    if (stored < 1)
      throw InputError(fmt::format("'{}' holds {} frames (at least 2 are compared). Leave it out", source, stored + 1));
    if (options.frames > stored)
      throw ConfigError(
          fmt::format("--frames {} is more than '{}' holds (allowed: 1 to {}). Ask for fewer, or name "
                      "the scene file",
                      options.frames, source, stored));
    task.frames = options.frames > 0 ? options.frames : stored;
    trajectory.frames = reader.frames(i, 0, task.frames + 1);
    check_stored_frames(trajectory.frames, 0, "'" + source + "'");
    task.initial_velocity = reader.initial_velocity(i);
    if (task.initial_velocity.empty()) task.initial_velocity = trajectory.frames.front().velocity;
    if (task.initial_velocity.empty())
      throw InputError("'" + source + "' stores no velocity of the first frame. Use a data set made by graupel");
    for (ParticleFrame& frame : trajectory.frames) std::vector<Vec3f>().swap(frame.velocity);
    task.forces = {reader.contact_names(i), reader.contact_forces(i)};
    if (!task.forces.names.empty()) task.forces.frames.resize(trajectory.frames.size());
    task.stored = std::move(trajectory);
    tasks.push_back(std::move(task));
  }
  return tasks;
}

mpm::Split split_named(const std::string& word) {
  std::string allowed;
  for (const mpm::Split split : mpm::all_splits) {
    if (word == mpm::name_of(split)) return split;
    allowed += (allowed.empty() ? "" : ", ") + std::string(mpm::name_of(split));
  }
  throw ConfigError("--split '" + word + "' is unknown (allowed: " + allowed + "). Correct it");
}

/// Of a recipe or of the folder of a data set, which cannot do without.
mpm::Split needed_split(const std::string& path, const CompareOptions& options) {
  if (options.split.empty())
    throw ConfigError("'" + path + "' has several splits. Choose one with --split (allowed: train, valid, test)");
  return split_named(options.split);
}

std::vector<SceneTask> read_recipe(const std::string& path, const SceneRange& wanted, const CompareOptions& options) {
  const mpm::Split split = needed_split(path, options);
  const auto recipe = open_recipe({.recipe = path,
                                   .set = options.set,
                                   .fields = "",
                                   .seed = options.seed.value_or(0),
                                   .seed_given = options.seed.has_value()});
  const int64_t there = recipe->count(split);
  if (there == 0)
    throw ConfigError(
        fmt::format("the {} split of '{}' has no scenes. Choose another --split, or raise its count with "
                    "--set counts.{}=N",
                    mpm::name_of(split), path, mpm::name_of(split)));
  const SceneRange range = range_within(wanted, there, fmt::format("the {} split of '{}'", mpm::name_of(split), path));
  std::vector<SceneTask> tasks;
  for (int64_t i = range.first; i < range.end; ++i) {
    SceneTask task;
    task.scene = recipe->scene({split, i});
    task.source = fmt::format("{}#{}", path, i);
    task.category = category_of(task.scene.name);
    task.seed = task.scene.seed;
    task.frames = options.frames > 0 ? options.frames : task.scene.frames;
    tasks.push_back(std::move(task));
  }
  return tasks;
}

/// "8" (the first eight) or "8:16" (those from 8 to 15); nothing for other words, which are paths.
std::optional<SceneRange> range_of(const std::string& word) {
  SceneRange range{0, 0, word};
  const char* const last = word.data() + word.size();
  std::from_chars_result read = std::from_chars(word.data(), last, range.end);
  if (read.ec == std::errc() && read.ptr != last && *read.ptr == ':') {
    range.first = range.end;
    read = std::from_chars(read.ptr + 1, last, range.end);
  }
  if (read.ec != std::errc() || read.ptr != last) return {};
  return range;
}

/// What is named in --scenes: paths, and which scenes of recipes and data sets.
struct NamedScenes {
  std::vector<std::string> paths;
  SceneRange range;
};

NamedScenes names_of(const std::vector<std::string>& words) {
  NamedScenes names;
  for (const std::string& word : words) {
    const std::optional<SceneRange> range = range_of(word);
    if (!range) {
      names.paths.push_back(word);
      continue;
    }
    if (range->first < 0 || range->end <= range->first || !names.range.word.empty())
      throw ConfigError("--scenes " + word +
                        " is no number of scenes (allowed: one number, at least 1, or one range FIRST:END with "
                        "0 <= FIRST < END). Correct it");
    names.range = *range;
  }
  return names;
}

bool is_data_set_folder(const std::string& path) { return is_there(path + "/dataset.json"); }

std::vector<std::string> scenes_of_folder(const std::string& path) {
  check_readable(path);
  std::vector<std::string> inside;
  for (const std::string& name : names_in(path))
    if (name.ends_with(".json")) inside.push_back(fs::path(path) / name);
  if (inside.empty()) throw ConfigError("no scene (*.json) in folder '" + path + "'. Name another with --scenes");
  return inside;
}

/// Names are keys of rows, and of pictures the names of files.
void check_names_differ(const std::vector<SceneTask>& tasks, bool with_pictures) {
  std::map<std::string, std::string> source_of;
  for (const SceneTask& task : tasks) {
    const std::string name = with_pictures ? file_name_of(task.scene.name) : task.scene.name;
    const auto [found, added] = source_of.emplace(name, task.source);
    if (!added)
      throw ConfigError(fmt::format("'{}' and '{}' are both named '{}'. Change \"name\" in one, or compare them apart",
                                    found->second, task.source, name));
  }
}

}  // namespace

std::vector<SceneTask> read_scene_tasks(const CompareOptions& options) {
  if (!options.split.empty()) split_named(options.split);
  const NamedScenes names = names_of(options.scenes);
  std::vector<SceneTask> tasks;
  bool split_used = false, range_used = false;
  const auto add = [&](std::vector<SceneTask> more) {
    for (SceneTask& task : more) {
      if (task.frames < 1)
        throw ConfigError("'" + task.source + "' has no frame after the first. Give --frames 1 or more");
      tasks.push_back(std::move(task));
    }
  };
  for (const std::string& path : names.paths) {
    const bool of_folder = is_data_set_folder(path);
    if (of_folder || path.ends_with(".h5")) {
      const fs::path file = of_folder
                                ? fs::path(path) / (mpm::name_of(needed_split(path, options)) + std::string(".h5"))
                                : fs::path(path);
      add(read_data_set(file, names.range, options));
      split_used = split_used || of_folder;
      range_used = true;
    } else if (is_folder(path)) {
      for (const std::string& file : scenes_of_folder(path)) add({read_scene_file(file, options)});
    } else if (is_recipe(path)) {
      add(read_recipe(path, names.range, options));
      split_used = range_used = true;
    } else {
      add({read_scene_file(path, options)});
    }
  }
  check_names_differ(tasks, !options.pictures.empty());
  if (tasks.empty()) throw ConfigError("compare needs at least one scene. Example: --scenes scenes/shared");
  if (!options.split.empty() && !split_used)
    throw ConfigError("--split " + options.split +
                      " is for recipes and folders of data sets, and --scenes names none. Leave it out");
  if (!names.range.word.empty() && !range_used)
    throw ConfigError(fmt::format(
        "--scenes {} chooses scenes of recipes and data sets, and none is named. Leave it out", names.range.word));
  return tasks;
}

}  // namespace graupel::experiments
