// What the scenes of a training cover, as metadata of the weights file: training.ranges, training.contacts and
// training.changes. Models whose scenes lie outside are not refused; who runs them says so.
#pragma once

#include <map>
#include <set>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/scene/scene.h"
#include "nn/weights.h"

namespace graupel::nn {

struct TrainedBox {
  /// Lowest and highest value of each constant, by "law.key" ("sand.friction_angle"), and of "contact.friction".
  std::map<std::string, std::pair<double, double>> ranges;
  std::set<std::string> contacts;  ///< kinds of walls and of obstacles' contact, in words

  /// What changed in some scene: "moving obstacles", "particles that come or go", "periodic walls", "particles that
  /// follow a script".
  std::set<std::string> changes;

  void widen(const Scene& scene);  ///< so that it holds the scene's
  bool is_told() const { return !ranges.empty(); }
  /// A line for each constant of the scene's materials outside the ranges: "sand.friction_angle is 50, of the training
  /// 20 to 45". None where the box is not told.
  std::vector<std::string> unlike_materials(const Scene& scene) const;
  /// The same for friction and kinds of contact.
  std::vector<std::string> unlike_contacts(const Scene& scene) const;

  /// A line for each kind of change of the scene that no scene of the training had, told or not.
  std::vector<std::string> unlike_changes(const Scene& scene) const;

  void store(std::map<std::string, std::string>& metadata) const;
  /// Not told where the metadata lack it. Throws InputError naming file and key for what is no such JSON.
  static TrainedBox load(const Weights& weights);
};

/// Calls visit("law.key", value) for the numbers of a material that its law uses.
template <typename Visit>
void visit_constants(const MaterialConfig& material, Visit&& visit) {
  const std::string law = particle_type_name(particle_type_of(material.model));
  MaterialConfig::fields([&](auto member, const FieldInfo& info) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>) {
      std::istringstream laws{std::string(info.only_for)};
      bool is_used = info.only_for.empty();
      for (std::string word; laws >> word;) is_used = is_used || word == law;
      if (is_used) visit(std::string(law).append(".").append(info.name), material.*member);
    }
  });
}

}  // namespace graupel::nn
