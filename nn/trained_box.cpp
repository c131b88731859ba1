#include "nn/trained_box.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/scene/materials_by_type.h"
#include "core/scene/scripts.h"
#include "core/system/error.h"

namespace graupel::nn {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char *ranges_key = "training.ranges", *contacts_key = "training.contacts",
                     *changes_key = "training.changes";

template <typename Visit>
void visit_materials(const Scene& scene, Visit&& visit) {
  for (const auto& [name, material] : materials_in_use(scene)) visit_constants(material, visit);
}

template <typename Visit>
void visit_frictions(const Scene& scene, Visit&& visit) {
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const int side : {0, 1}) visit("contact.friction", scene.domain.friction(axis, side));
  for (const Obstacle& obstacle : scene.obstacles) visit("contact.friction", obstacle.friction);
}

template <typename Enum>
std::string word_of_enum(Enum value) {
  for (const auto& [word, known] : EnumWords<Enum>::words)
    if (known == value) return word;
  return "";
}

/// Kinds of walls and contacts of obstacles, in words.
std::set<std::string> contacts_of(const Scene& scene) {
  std::set<std::string> words;
  for (int axis = 0; axis < scene.domain.axes(); ++axis)
    for (const int side : {0, 1}) words.insert(word_of_enum(scene.domain.wall(axis, side)));
  for (const Obstacle& obstacle : scene.obstacles) words.insert(word_of_enum(obstacle.contact));
  return words;
}

std::set<std::string> changes_of(const Scene& scene) {
  const std::pair<bool, const char*> kinds[] = {{scene.has_moving_obstacles(), "moving obstacles"},
                                                {scene.has_inactive_particles(), "particles that come or go"},
                                                {scene.domain.has_wall(Wall::periodic), "periodic walls"},
                                                {has_scripts(scene), "particles that follow a script"}};
  std::set<std::string> words;
  for (const auto& [has, word] : kinds)
    if (has) words.insert(word);
  return words;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

/// Adds a line for a number outside its range, once.
void judge(const TrainedBox& box, const std::string& key, double value, std::vector<std::string>& lines) {
  const auto range = box.ranges.find(key);
  std::string line;
  if (range == box.ranges.end())
    line = key + " is " + number(value) + "; the training had no such constant";
  else if (value < range->second.first * (1 - 1e-9) || value > range->second.second * (1 + 1e-9))
    line = key + " is " + number(value) + ", of the training " + number(range->second.first) + " to " +
           number(range->second.second);
  if (!line.empty() && std::find(lines.begin(), lines.end(), line) == lines.end()) lines.push_back(line);
}

template <typename T>
void read_json(const Weights& weights, const char* key, T& value) {
  const auto found = weights.metadata.find(key);
  if (found == weights.metadata.end()) return;
  try {
    value = Json::parse(found->second).get<T>();
  } catch (const Json::exception& error) {
    throw InputError("'" + weights.file + "': metadata key '" + key + "' is not what training writes (" + error.what() +
                     "). Train the model again");
  }
}

}  // namespace

void TrainedBox::widen(const Scene& scene) {
  const auto add = [&](const std::string& key, double value) {
    const auto [range, added] = ranges.try_emplace(key, value, value);
    range->second = {std::min(range->second.first, value), std::max(range->second.second, value)};
  };
  visit_materials(scene, add);
  visit_frictions(scene, add);
  contacts.merge(contacts_of(scene));
  changes.merge(changes_of(scene));
}

std::vector<std::string> TrainedBox::unlike_materials(const Scene& scene) const {
  std::vector<std::string> lines;
  if (!is_told()) return lines;
  visit_materials(scene, [&](const std::string& key, double value) { judge(*this, key, value, lines); });
  return lines;
}

std::vector<std::string> TrainedBox::unlike_contacts(const Scene& scene) const {
  std::vector<std::string> lines;
  if (!is_told()) return lines;
  visit_frictions(scene, [&](const std::string& key, double value) { judge(*this, key, value, lines); });
  std::string known;
  for (const std::string& word : contacts) known += (known.empty() ? "" : ", ") + word;
  for (const std::string& word : contacts_of(scene))
    if (!contacts.contains(word)) lines.push_back("contact is " + word + ", of the training " + known);
  return lines;
}

std::vector<std::string> TrainedBox::unlike_changes(const Scene& scene) const {
  std::vector<std::string> lines;
  for (const std::string& kind : changes_of(scene))
    if (!changes.contains(kind)) lines.push_back("the training had no scene with " + kind);
  return lines;
}

void TrainedBox::store(std::map<std::string, std::string>& metadata) const {
  metadata[ranges_key] = Json(ranges).dump();
  metadata[contacts_key] = Json(contacts).dump();
  metadata[changes_key] = Json(changes).dump();
}

TrainedBox TrainedBox::load(const Weights& weights) {
  TrainedBox box;
  read_json(weights, ranges_key, box.ranges);
  read_json(weights, contacts_key, box.contacts);
  read_json(weights, changes_key, box.changes);
  return box;
}

}  // namespace graupel::nn
