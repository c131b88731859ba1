#include "mpm/scene/particle_materials.h"

#include <fmt/format.h>

#include <iterator>

#include "core/scene/materials_by_type.h"
#include "core/system/error.h"
#include "mpm/sampling.h"

namespace graupel::mpm {

namespace {

/// Whether all numbers of a material are those that a material of its model has when nothing is said of them.
bool is_all_default(const MaterialConfig& material) {
  const MaterialConfig untold;
  bool same = material.preset.empty();
  MaterialConfig::fields([&](auto member, const FieldInfo&) {
    if constexpr (std::is_same_v<decltype(member), double MaterialConfig::*>)
      same = same && material.*member == untold.*member;
  });
  return same;
}

void check_told(const Scene& scene, const std::string& where) {
  for (const auto& [name, material] : scene.materials)
    if (material.model != MaterialModel::stationary && is_all_default(material))
      throw InputError(fmt::format(
          "{} is of another program's data, whose scene tells no constants (key materials.{}: those of its model {} by "
          "default), and the network sees them (material_constants true). Convert the data with --set "
          "materials.{}.preset=... or its constants, or train with material_constants=false",
          where, name, word_of(material.model), name));
}

/// Of those that the file keeps; the scene's materials may be more, where --set or a training changed them.
std::vector<int32_t> stored_materials(const Scene& scene, const ParticleMaterials& stored, const std::string& where) {
  std::vector<int32_t> place;  // in the scene
  for (const std::string& name : stored.names) {
    const auto found = scene.materials.find(name);
    place.push_back(found == scene.materials.end()
                        ? MaterialsByType::none
                        : static_cast<int32_t>(std::distance(scene.materials.begin(), found)));
  }
  std::vector<int32_t> indices;
  indices.reserve(stored.index.size());
  for (const int32_t i : stored.index) {
    indices.push_back(i < 0 ? MaterialsByType::none : place[static_cast<std::size_t>(i)]);
    if (i >= 0 && indices.back() < 0)
      throw InputError(where + " has particles of the material '" + stored.names[static_cast<std::size_t>(i)] +
                       "', which its scene lacks. Make it again, of the scene's materials");
  }
  return indices;
}

std::vector<int32_t> materials_sampled_again(const Scene& scene, const Trajectory& header,
                                             const std::vector<Vec3f>& start, const std::string& where) {
  constexpr double tolerance = 1e-4;  // [m], far below the distance of particles
  const auto refuse = [&](const std::string& what) {
    return InputError(
        fmt::format("{} has two materials of one law, and {}, so that the material of each particle is not known. "
                    "Generate the data again, or use a network without material_constants",
                    where, what));
  };
  const SampledParticles sampled = sample_sources(scene, header.seed);
  if (sampled.material.size() != header.particle_type.size())
    throw refuse(fmt::format("its scene and seed give another number of particles ({}, stored {})",
                             sampled.material.size(), header.particle_type.size()));
  std::vector<MaterialModel> model;
  for (const auto& [name, material] : scene.materials) model.push_back(material.model);
  for (std::size_t i = 0; i < start.size(); ++i) {
    const bool same_law =
        particle_type_of(model[static_cast<std::size_t>(sampled.material[i])]) == header.particle_type[i];
    if (!same_law || !(norm(sampled.position[i] - start[i].cast<double>()) <= tolerance))
      throw refuse(fmt::format("its scene and seed place particle {} elsewhere", i));
  }
  return sampled.material;
}

}  // namespace

std::vector<int32_t> particle_materials(const Scene& scene, const Trajectory& header, const std::vector<Vec3f>& start,
                                        const std::string& where) {
  const MaterialsByType by_type(scene.materials);
  if (!header.materials.empty()) return stored_materials(scene, header.materials, where);
  if (!by_type.tells_all()) return materials_sampled_again(scene, header, start, where);
  return by_type.indices(header.particle_type, where);
}

std::vector<int32_t> network_materials(const Scene& scene, const Trajectory& header, const std::vector<Vec3f>& start,
                                       const std::string& where) {
  if (header.made_by.starts_with("converted from")) check_told(scene, where);
  return particle_materials(scene, header, start, where);
}

ParticleMaterials kept_materials(const Scene& scene, uint64_t seed) {
  if (MaterialsByType(scene.materials).tells_all()) return {};
  return graupel::kept_materials(scene.materials, sample_sources(scene, seed).material);
}

}  // namespace graupel::mpm
