#include "core/scene/materials_by_type.h"

#include <algorithm>
#include <set>
#include <utility>

#include "core/scene/scene.h"
#include "core/system/error.h"

namespace graupel {

MaterialsByType::MaterialsByType(const std::map<std::string, MaterialConfig>& materials) {
  int32_t index = 0;
  for (const auto& [name, material] : materials) of_type_[particle_type_of(material.model)].push_back({name, index++});
}

bool MaterialsByType::tells_all() const {
  return std::all_of(of_type_.begin(), of_type_.end(), [](const auto& entry) { return entry.second.size() == 1; });
}

std::vector<int32_t> MaterialsByType::indices(const std::vector<int32_t>& particle_type,
                                              const std::string& where) const {
  std::vector<int32_t> indices;
  indices.reserve(particle_type.size());
  for (const int32_t type : particle_type) {
    if (type == obstacle_particle_type) {
      indices.push_back(none);
      continue;
    }
    const auto found = of_type_.find(type);
    if (found == of_type_.end())
      throw InputError(where + " has particles of a type that its scene has no material of (" +
                       particle_type_name(type) + "). Make it again, of the scene's materials");
    const std::vector<Named>& materials = found->second;
    if (materials.size() > 1)
      throw ConfigError(where + " has materials '" + materials[0].name + "' and '" + materials[1].name +
                        "' of one law (" + particle_type_name(type) +
                        "), so that the particles' types do not tell which of them a particle is of. Give the "
                        "particles' materials");
    indices.push_back(materials[0].index);
  }
  return indices;
}

ParticleMaterials kept_materials(const std::map<std::string, MaterialConfig>& materials, std::vector<int32_t> index) {
  constexpr std::size_t most_names = 4096;
  if (MaterialsByType(materials).tells_all() || materials.size() > most_names) return {};
  ParticleMaterials kept{std::move(index), {}};
  for (const auto& [name, material] : materials) kept.names.push_back(name);
  return kept;
}

std::map<std::string, MaterialConfig> materials_in_use(const Scene& scene) {
  std::set<std::string> names;
  for (const Source& source : scene.sources) names.insert(source.material);
  for (const Emitter& emitter : scene.emitters) names.insert(emitter.material);
  std::map<std::string, MaterialConfig> used;
  for (const auto& [name, config] : scene.materials)
    if (names.contains(name)) used.emplace(name, config);
  return used;
}

}  // namespace graupel
