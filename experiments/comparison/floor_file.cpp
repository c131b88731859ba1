#include "experiments/comparison/floor_file.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/system/atomic_file.h"
#include "core/system/error.h"
#include "mpm/scene/scene_hash.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* format = "graupel floors";
constexpr const char* remedy = "Measure them again with `graupel compare ... --write-floors FILE`";

SceneFloors floors_from(const Json& json) {
  SceneFloors floors;
  floors.scene_hash = std::stoull(json.at("scene_hash").get<std::string>(), nullptr, 16);
  floors.frames = json.at("frames").get<int64_t>();
  floors.values = json.at("values").get<compare::MetricValues>();
  floors.position = json.at("position").get<std::vector<double>>();
  floors.density = json.at("density").get<std::vector<double>>();
  floors.diverged = json.at("diverged").get<std::map<std::string, int64_t>>();
  return floors;
}

Json json_of(const SceneFloors& floors) {
  return {{"scene_hash", fmt::format("{:016x}", floors.scene_hash)},
          {"frames", floors.frames},
          {"values", floors.values},
          {"position", floors.position},
          {"density", floors.density},
          {"diverged", floors.diverged}};
}

}  // namespace

bool is_floor_file(const std::string& path) {
  const Json json = Json::parse(read_file(path), nullptr, /*allow_exceptions=*/false);
  return json.is_object() && json.contains("format") && json.at("format") == format;
}

FloorFile::FloorFile(const std::string& path) : path_(path) {
  const std::string text = read_file(path);
  std::string place = "the file";
  try {
    const Json json = Json::parse(text);
    if (json.at("format") != format || json.at("version") != 1)
      throw InputError(
          fmt::format("'{}' is no file of chaos floors that this program reads (format {}, version {}; "
                      "allowed: \"graupel floors\", 1). {}",
                      path, json.at("format").dump(), json.at("version").dump(), remedy));
    for (const auto& [name, scene] : json.at("scenes").items()) {
      place = "scenes." + name;
      scenes_[name] = floors_from(scene);
    }
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("'{}' is no file of chaos floors: {} ({}). {}", path, place, error.what(), remedy));
  } catch (const std::logic_error&) {  // of std::stoull
    throw InputError(fmt::format("'{}' is no file of chaos floors: {}.scene_hash is no hexadecimal number. {}", path,
                                 place, remedy));
  }
}

const SceneFloors& FloorFile::of(const Scene& scene, uint64_t seed, int64_t frames) const {
  const auto found = scenes_.find(scene.name);
  if (found == scenes_.end())
    throw InputError(fmt::format("'{}' holds no chaos floors of scene '{}'. {}", path_, scene.name, remedy));
  const SceneFloors& floors = found->second;
  if (floors.scene_hash != mpm::rounded_scene_hash(scene, seed))
    throw InputError(
        fmt::format("the chaos floors of '{}' in '{}' are stale: the scene or its seed ({}) is another "
                    "than the one they were measured on. {}",
                    scene.name, path_, seed, remedy));
  if (floors.frames != frames)
    throw InputError(
        fmt::format("the chaos floors of '{}' in '{}' are of {} frames, not of {}. Give --frames {}, or "
                    "measure them again with `graupel compare ... --write-floors FILE`",
                    scene.name, path_, floors.frames, frames, floors.frames));
  return floors;
}

void FloorFile::write(const std::string& path) const {
  Json json = {{"format", format}, {"version", 1}, {"scenes", Json::object()}};
  for (const auto& [name, floors] : scenes_) json["scenes"][name] = json_of(floors);
  write_file_atomically(path, json.dump(1) + "\n");
}

}  // namespace graupel::experiments
