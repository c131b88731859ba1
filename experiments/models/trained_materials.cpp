#include "experiments/models/trained_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "core/scene/material_config.h"
#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "graph/features/material_constants.h"
#include "io/config/config_writer.h"
#include "io/scene/scene_reader.h"
#include "nn/trained_box.h"

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
    if (!materials.is_object() || materials.empty())
      throw InputError(place + " names no material (" + text.substr(0, 60) +
                       ", needed: an object of them by name). Train the network again, or copy the file anew");
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

/// Whether the network has the input "material_constants" or "contact".
bool sees(const nn::Weights& weights, const std::string& input) {
  for (const char* prefix : {"hgn.", "gns."}) {
    const auto found = weights.metadata.find(prefix + input);
    if (found != weights.metadata.end()) return found->second == "true";
  }
  return false;
}

/// Whether graph::material_constants tells a material from one that has `other` as its constant "law.key".
bool is_feature(const MaterialConfig& material, const std::string& key, double other) {
  MaterialConfig changed = material;
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>)
      if (key.substr(key.find('.') + 1) == info.name) changed.*member = other;
  });
  const graph::MaterialConstants a = graph::material_constants(material), b = graph::material_constants(changed);
  return !std::equal(std::begin(a.feature), std::end(a.feature), std::begin(b.feature));
}

/// "the network has no input for sand.friction_angle: it is 33, and the training had 20 to 45", for a number of the
/// scene that the training varied.
void name_varied(const nn::TrainedBox& box, const std::string& key, double value, std::vector<std::string>& lines) {
  const auto range = box.ranges.find(key);
  if (range == box.ranges.end() || range->second.first == range->second.second) return;
  if (value < range->second.first || value > range->second.second) return;  // which is told already
  const std::string line =
      fmt::format("the network has no input for {}: it is {:.6g}, and the training had {:.6g} to {:.6g}", key, value,
                  range->second.first, range->second.second);
  if (std::find(lines.begin(), lines.end(), line) == lines.end()) lines.push_back(line);
}

std::vector<std::string> outside(std::vector<std::string> lines) {
  for (std::string& line : lines) line = "outside the training: " + line;
  return lines;
}

std::vector<std::string> unlike_ranges(const nn::Weights& weights, const nn::TrainedBox& box, const Scene& scene) {
  std::vector<std::string> lines = outside(box.unlike_materials(scene));
  const bool sees_constants = sees(weights, "material_constants");
  for (const auto& [name, material] : materials_in_use(scene))
    nn::visit_constants(material, [&, &own = material](const std::string& key, double value) {
      if (!sees_constants || !is_feature(own, key, 2 * value + 1)) name_varied(box, key, value, lines);
    });
  return lines;
}

std::vector<std::string> unlike_contacts(const nn::Weights& weights, const nn::TrainedBox& box, const Scene& scene) {
  std::vector<std::string> lines = outside(box.unlike_contacts(scene));
  if (sees(weights, "contact")) return lines;
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const int side : {0, 1}) name_varied(box, "contact.friction", scene.domain.friction(axis, side), lines);
  for (const Obstacle& obstacle : scene.obstacles) name_varied(box, "contact.friction", obstacle.friction, lines);
  if (box.contacts.size() > 1)
    lines.push_back(fmt::format("the network has no input for the kind of contact, and the training had {}",
                                fmt::join(box.contacts, ", ")));
  return lines;
}

}  // namespace

std::vector<std::string> unlike_training(const nn::Weights& weights, const Scene& scene) {
  if (const auto box = nn::TrainedBox::load(weights); box.is_told()) return unlike_ranges(weights, box, scene);
  const auto known = weights.metadata.find("training.materials");
  if (known == weights.metadata.end()) return {};
  const auto trained = read_materials(weights, known->second);
  std::vector<std::string> lines;
  for (const auto& [name, material] : materials_in_use(scene)) {
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
  if (const auto box = nn::TrainedBox::load(weights); box.is_told()) {
    lines = unlike_contacts(weights, box, scene);
    const std::vector<std::string> changes = box.unlike_changes(scene);
    lines.insert(lines.end(), changes.begin(), changes.end());
    return lines;
  }
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
  const std::vector<std::string> changes = nn::TrainedBox().unlike_changes(scene);
  lines.insert(lines.end(), changes.begin(), changes.end());
  return lines;
}

std::vector<std::string> unknown_forces(const Scene& scene) {
  std::vector<std::string> lines;
  if (!scene.loads.empty())
    lines.push_back(
        fmt::format("the network has no input for loads: it leaves out the scene's {}", scene.loads.size()));
  if (scene.has_changing_gravity())
    lines.push_back("the network has no input for gravity that changes: it has that at time 0 throughout");
  return lines;
}

std::vector<std::string> training_remarks(const nn::Weights& weights, const Scene& scene) {
  const bool tells_ranges = nn::TrainedBox::load(weights).is_told();
  std::vector<std::string> lines;
  for (const std::string& line : unlike_training(weights, scene))
    lines.push_back((tells_ranges ? "" : "the network knows materials by their type alone: ") + line);
  for (const std::string& line : unknown_walls(weights, scene)) lines.push_back(line);
  for (const std::string& line : unknown_forces(scene)) lines.push_back(line);
  return lines;
}

}  // namespace graupel::experiments
