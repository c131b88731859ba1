#include "io/scene/sweep_reader.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/scene/particle_fields.h"
#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "io/config/config_reader.h"
#include "io/config/config_writer.h"
#include "io/scene/scene_reader.h"
#include "io/scene/sweep_draw.h"

namespace graupel::io {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t largest_file = std::size_t(16) << 20;
using Overrides = std::vector<std::string>;

ConfigPlace parameter_place(const ConfigDocument& document, std::size_t parameter,
                            const std::vector<std::string>& keys = {}) {
  std::vector<std::string> all = {"parameters", std::to_string(parameter)};
  all.insert(all.end(), keys.begin(), keys.end());
  return find_place(document, all);
}

/// The recipe's own overrides, and those of its scene without "scene.".
struct SplitOverrides {
  Overrides recipe, scene;
};

SplitOverrides split(const Overrides& overrides, const std::string& name) {
  SplitOverrides split;
  for (const std::string& text : overrides) {
    if (text.starts_with("set."))
      throw ConfigError(name + " (override " + text + "): the keys of 'set' are paths themselves. Write scene." +
                        text.substr(4));
    const bool of_scene = text.starts_with("scene.") && text.find('=') != std::string::npos;
    if (of_scene)
      split.scene.push_back(text.substr(6));
    else
      split.recipe.push_back(text);
  }
  return split;
}

/// Puts "key.path=value" into the recipe's `set`, where it replaces what is there for that key and inside it.
void add_to_set(ConfigDocument& document, const std::string& text) {
  const std::string override_text = "scene." + text;
  const auto equals = text.find('=');
  const std::string key = text.substr(0, equals);
  JsonNode value = override_value(text.substr(equals + 1), document.name + " (override " + override_text + "): ");
  mark_override(value, override_text);
  JsonNode* set = document.root.find("set");
  if (!set) set = &document.root.set("set", JsonNode::object());
  std::erase_if(set->members, [&](const JsonMember& member) { return member.key.starts_with(key + "."); });
  set->set(key, std::move(value));
}

void check_length(const ConfigPlace& values, std::size_t length, const SweepParameter& first, std::size_t wanted) {
  if (length == wanted) return;
  config_fail(values, "has " + std::to_string(length) + " values, and '" + first.name + "' " + std::to_string(wanted),
              "Give every list as many values as there are runs");
}

void check_parameters(const ConfigDocument& document, const SweepRecipe& recipe) {
  if (recipe.parameters.empty())
    config_fail(find_place(document, {"parameters"}), "names no parameter", "Give at least one");
  const SweepParameter& first = recipe.parameters.front();
  if (first.values.empty())
    config_fail(parameter_place(document, 0, {"values"}), "has no value",
                "Give one for each run: values, or range and draw");
  std::set<std::string> names, keys;
  const auto check_key = [&](const ConfigPlace& place, const std::string& key) {
    if (recipe.set.count(key))
      config_fail(find_place(document, {"set", key}), "has no effect: a parameter sets this key", "Remove it");
    if (!keys.insert(key).second)
      config_fail(place, "is given twice (" + key + ")", "Let one list of values set this key");
  };
  for (std::size_t p = 0; p < recipe.parameters.size(); ++p) {
    const SweepParameter& parameter = recipe.parameters[p];
    if (parameter.name.empty()) config_fail(parameter_place(document, p, {"name"}), "is empty", "Name the parameter");
    if (!names.insert(parameter.name).second)
      config_fail(parameter_place(document, p, {"name"}), "is given twice (" + parameter.name + ")",
                  "Name each parameter differently");
    check_key(parameter_place(document, p, {"key"}), parameter.key);
    check_length(parameter_place(document, p, {"values"}), parameter.values.size(), first, first.values.size());
    for (std::size_t a = 0; a < parameter.also.size(); ++a) {
      const auto place = [&](const char* key) {
        return parameter_place(document, p, {"also", std::to_string(a), key});
      };
      check_key(place("key"), parameter.also[a].key);
      check_length(place("values"), parameter.also[a].values.size(), first, first.values.size());
    }
  }
}

void check_splits(const ConfigDocument& document, const SweepRecipe& recipe) {
  const auto runs = static_cast<int64_t>(recipe.parameters.front().values.size());
  std::set<int64_t> used;
  for (const auto& [name, list] : {std::pair("test", &recipe.test), std::pair("valid", &recipe.valid)})
    for (std::size_t i = 0; i < list->size(); ++i) {
      const ConfigPlace place = find_place(document, {name, std::to_string(i)});
      const std::string run = std::to_string((*list)[i]);
      if ((*list)[i] >= runs)
        config_fail(place, "is not a run (" + run + ", allowed 0 to " + std::to_string(runs - 1) + ")",
                    "Runs are counted from 0");
      if (!used.insert((*list)[i]).second)
        config_fail(place, "names a run twice (" + run + ")", "Each run belongs to one of test, valid and training");
    }
  const bool none_left = static_cast<int64_t>(used.size()) == runs;
  if (none_left && recipe.training == TrainingRuns::rest)
    config_fail(
        find_place(document, {"test"}),
        "and 'valid' leave no run for training (" + std::to_string(runs) + " of " + std::to_string(runs) + " used)",
        "Take some out of the lists, or write \"training\": \"none\" for a set that only tests");
  if (!none_left && recipe.training == TrainingRuns::none)
    config_fail(find_place(document, {"training"}),
                "is none, and " + std::to_string(runs - static_cast<int64_t>(used.size())) +
                    " runs are in neither 'test' nor 'valid'",
                "Add them to these lists");
}

void check_fields(const ConfigDocument& document, const SweepRecipe& recipe) {
  try {
    FieldSet::parse(recipe.fields_stored);
  } catch (const ConfigError& error) {
    throw ConfigError(find_place(document, {"fields"}).text() + " is not a list of fields: " + error.what());
  }
}

/// Makes scenes from the recipe's scene file.
class SceneMaker {
 public:
  SceneMaker(const ConfigDocument& document, const SweepRecipe& recipe)
      : document_(document),
        recipe_(recipe),
        file_((fs::path(document.name).parent_path() / recipe.scene).lexically_normal().string()) {
    std::error_code code;
    if (!fs::is_regular_file(file_, code))
      throw InputError(find_place(document, {"scene"}).text() + " names a file that is not there ('" + file_ +
                       "'). Paths are relative to the recipe's folder");
    text_ = read_file(file_, largest_file);
    for (const auto& [key, value] : recipe.set) set_.push_back(key + "=" + value.json);
  }

  /// The scene file without comments, on one line.
  std::string file_json() const { return write_json(parse_json(text_, file_), JsonLayout::compact); }

  /// The scene with `set` alone.
  Scene base() const {
    try {
      return make(set_);
    } catch (const ConfigError& error) {
      throw ConfigError(find_place(document_, {set_.empty() ? "scene" : "set"}).text() + ": " + error.what());
    }
  }

  Scene run(std::size_t number, const std::string& run_text) const {
    Overrides all = set_;
    for (const SweepParameter& parameter : recipe_.parameters) add_values(parameter, number, all);
    try {
      return make(all);
    } catch (const ConfigError& error) {
      throw ConfigError(blame(number) + " makes a bad scene of " + run_text + ": " + error.what());
    }
  }

 private:
  static void add_values(const SweepParameter& parameter, std::size_t run, Overrides& overrides) {
    overrides.push_back(parameter.key + "=" + number_text(parameter.values[run]));
    for (const SweepFollower& follower : parameter.also)
      overrides.push_back(follower.key + "=" + follower.values[run].json);
  }

  Scene make(const Overrides& overrides) const {
    const std::string folder = fs::absolute(file_).parent_path().string();
    Scene scene = parse_scene(text_, file_, folder, overrides);
    scene.file = file_;
    return scene;
  }

  /// The place of the parameter that alone makes the scene bad, or else of all.
  std::string blame(std::size_t run) const {
    for (std::size_t p = 0; p < recipe_.parameters.size(); ++p) {
      Overrides alone = set_;
      add_values(recipe_.parameters[p], run, alone);
      try {
        make(alone);
      } catch (const ConfigError&) {
        return parameter_place(document_, p).text() + " ('" + recipe_.parameters[p].name + "')";
      }
    }
    return find_place(document_, {"parameters"}).text();
  }

  const ConfigDocument& document_;
  const SweepRecipe& recipe_;
  std::string file_, text_;
  Overrides set_;
};

/// The data set has one number of frames, one time between them and one sampling of the particles.
void check_same_frames(const ConfigDocument& document, const Sweep& sweep) {
  const Scene& first = sweep.scenes.front();
  for (int64_t run = 1; run < sweep.run_count(); ++run) {
    const Scene& scene = sweep.scenes[static_cast<std::size_t>(run)];
    for (const auto& [key, same] :
         {std::pair("frames", scene.frames == first.frames),
          std::pair("frame_time", scene.frame_time == first.frame_time), std::pair("seed", scene.seed == first.seed)})
      if (!same)
        config_fail(find_place(document, {"parameters"}),
                    "changes the scene's '" + std::string(key) + "' in " + sweep.run_text(run) +
                        ", which all runs of a data set share",
                    "Remove that parameter, or make a sweep for each value");
  }
}

}  // namespace

std::string Sweep::run_text(int64_t run) const {
  std::string text;
  for (const SweepParameter& parameter : recipe.parameters)
    text += (text.empty() ? "" : ", ") + parameter.name + " = " +
            number_text(parameter.values[static_cast<std::size_t>(run)]) +
            (parameter.unit.empty() ? "" : " " + parameter.unit);
  return "run " + std::to_string(run) + " (" + text + ")";
}

bool is_sweep(const std::string& path) {
  const JsonNode root = parse_json(read_file(path, largest_file), path);
  return root.find("scene") != nullptr;
}

Sweep read_sweep(const std::string& path, const std::vector<std::string>& overrides) {
  const SplitOverrides changes = split(overrides, path);
  ConfigDocument document = parse_document<SweepRecipe>(read_file(path, largest_file), path, changes.recipe);
  for (const std::string& change : changes.scene) add_to_set(document, change);
  Sweep sweep;
  sweep.recipe = read_config<SweepRecipe>(document);
  draw_runs(document, sweep.recipe);
  check_parameters(document, sweep.recipe);
  check_splits(document, sweep.recipe);
  check_fields(document, sweep.recipe);
  std::sort(sweep.recipe.test.begin(), sweep.recipe.test.end());
  std::sort(sweep.recipe.valid.begin(), sweep.recipe.valid.end());
  const SceneMaker maker(document, sweep.recipe);
  const Scene base = maker.base();
  if (sweep.recipe.name.empty()) sweep.recipe.name = base.name;
  sweep.base_scene = maker.file_json();
  for (std::size_t run = 0; run < sweep.recipe.parameters.front().values.size(); ++run)
    sweep.scenes.push_back(maker.run(run, sweep.run_text(static_cast<int64_t>(run))));
  check_same_frames(document, sweep);
  return sweep;
}

std::string sweep_to_json(const SweepRecipe& recipe) { return write_json(json_of(recipe), JsonLayout::indented); }

}  // namespace graupel::io
