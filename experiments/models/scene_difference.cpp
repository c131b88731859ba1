#include "experiments/models/scene_difference.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/system/error.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::json;

/// Keys that a run of a sweep may have otherwise than another one.
const std::set<std::string> free_keys = {"/name",   "/description", "/seed",
                                         "/frames", "/frame_time",  "/time_step/substeps_per_frame"};

Json without(const std::string& scene_json, const std::set<std::string>& keys) {
  Json scene = Json::parse(scene_json);
  for (const std::string& key : keys) {
    const Json::json_pointer pointer(key);
    if (scene.contains(pointer)) scene[pointer] = nullptr;
  }
  return scene;
}

}  // namespace

std::string pointer_of(std::string dotted_key) {
  std::replace(dotted_key.begin(), dotted_key.end(), '.', '/');
  return "/" + dotted_key;
}

std::optional<SceneDifference> scene_difference(const std::string& own, const std::string& other,
                                                const std::vector<std::string>& parameter_keys,
                                                const std::set<std::string>& also) {
  std::set<std::string> keys = free_keys;
  keys.insert(also.begin(), also.end());
  for (const std::string& key : parameter_keys) keys.insert(pointer_of(key));
  const Json difference = Json::diff(without(other, keys), without(own, keys));
  if (difference.empty()) return std::nullopt;
  std::string path = difference.front().at("path");
  if (path.ends_with("/-")) path.resize(path.size() - 2);  // an item more: the list as a whole
  const Json::json_pointer pointer(path);
  const auto text_at = [&](const std::string& scene) {
    const Json json = Json::parse(scene);
    return json.contains(pointer) ? json.at(pointer).dump() : std::string("nothing");
  };
  return SceneDifference{path, text_at(own), text_at(other)};
}

double number_at(const std::string& scene_json, const std::string& dotted_key, const std::string& file) {
  const Json scene = Json::parse(scene_json);
  const Json::json_pointer pointer(pointer_of(dotted_key));
  if (!scene.contains(pointer) || !scene.at(pointer).is_number())
    throw ConfigError("the scene has no number at '" + dotted_key + "', a parameter of '" + file +
                      "'. Use the scene that the training varied");
  return scene.at(pointer).get<double>();
}

}  // namespace graupel::experiments
