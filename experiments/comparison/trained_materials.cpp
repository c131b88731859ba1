#include "experiments/comparison/trained_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "core/scene/material_config.h"
#include "core/system/error.h"
#include "experiments/models/start_state.h"
#include "io/config/config_writer.h"
#include "io/scene/scene_reader.h"

namespace graupel::experiments {

namespace {

using Json = nlohmann::json;

Json resolved(const MaterialConfig& material) {
  return Json::parse(io::write_json(io::json_of_struct(material), io::JsonLayout::compact));
}

/// Materials as a scene file has them, presets resolved.
std::map<std::string, MaterialConfig> read_materials(const nn::Weights& weights, const std::string& text) {
  const std::string place = "'" + weights.file + "' (metadata training.materials)";
  try {
    const Json materials = Json::parse(text);
    const Json body = {{"shape", "box"},
                       {"size", {0.1, 0.1, 0.1}},
                       {"position", {0.5, 0.5, 0.5}},
                       {"material", materials.begin().key()}};  // scenes have one
    const Json scene = {
        {"domain", {{"size", {1, 1, 1}}, {"dx", 0.03125}}}, {"materials", materials}, {"sources", {body}}};
    return io::parse_stored_scene(scene.dump(), place, weights.file).materials;
  } catch (const Json::exception& error) {
    throw InputError(place + " is no JSON (" + error.what() + "). Train the network again");
  }
}

/// "friction_angle is 33, of the training 45", or nothing.
std::string first_difference(const Json& own, const Json& trained) {
  for (const auto& [key, value] : own.items()) {
    if (trained.at(key) == value) continue;
    return fmt::format("{} is {}, of the training {}", key, value.dump(), trained.at(key).dump());
  }
  return {};
}

}  // namespace

std::vector<std::string> unlike_training(const nn::Weights& weights, const Scene& scene) {
  const auto known = weights.metadata.find("training.materials");
  if (known == weights.metadata.end()) return {};
  const auto trained = read_materials(weights, known->second);
  std::vector<std::string> lines;
  for (const auto& [name, material] : scene.materials) {
    bool taught = false;
    std::string difference;
    for (const auto& [trained_name, candidate] : trained) {
      if (particle_type_of(candidate.model) != particle_type_of(material.model)) continue;
      const std::string found = first_difference(resolved(material), resolved(candidate));
      taught = taught || found.empty();
      difference = found;
    }
    if (taught) continue;
    lines.push_back(name + ": " + (difference.empty() ? "the training had no such material" : difference));
  }
  return lines;
}

std::vector<std::string> unknown_walls(const nn::Weights& weights, const Scene& scene) {
  std::vector<std::string> lines;
  if (!weights.metadata.contains("training.materials")) return lines;
  double walls = 0, obstacles = 0;
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const int side : {0, 1}) walls = std::max(walls, scene.domain.friction(axis, side));
  for (const Obstacle& obstacle : scene.obstacles) obstacles = std::max(obstacles, obstacle.friction);
  const auto add = [&](const char* what, double friction) {
    if (friction > 0)
      lines.push_back(fmt::format(
          "the network has no input for friction: that of {} is {}, and its training names none", what, friction));
  };
  if (scene.domain.has_wall(Wall::stick))
    lines.push_back("the network has no input for the kind of a wall: the scene has sticky ones");
  add("walls", walls);
  add("obstacles", obstacles);
  const std::pair<bool, const char*> changes[] = {{scene.has_moving_obstacles(), "moving obstacles"},
                                                  {scene.has_inactive_particles(), "particles that come or go"},
                                                  {scene.domain.has_wall(Wall::periodic), "periodic walls"},
                                                  {has_scripts(scene), "particles that follow a script"}};
  for (const auto& [has, what] : changes)
    if (has) lines.push_back(fmt::format("the training had no scene with {}", what));
  return lines;
}

}  // namespace graupel::experiments
