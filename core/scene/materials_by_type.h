// Which material of a scene a particle is of, by its type: files and networks tell a particle's law alone.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/scene/material_config.h"
#include "core/scene/trajectory.h"

namespace graupel {

class MaterialsByType {
 public:
  static constexpr int32_t none = -1;  ///< of obstacle particles

  explicit MaterialsByType(const std::map<std::string, MaterialConfig>& materials);

  /// Whether no two materials are of one law.
  bool tells_all() const;
  /// Indices into the materials in map order, of particles by their types [n]. Throws ConfigError naming two materials
  /// of one law where a particle is of one of them, InputError for a type without material; both name `where`.
  std::vector<int32_t> indices(const std::vector<int32_t>& particle_type, const std::string& where) const;

 private:
  struct Named {
    std::string name;
    int32_t index;
  };
  std::map<int32_t, std::vector<Named>> of_type_;
};

/// What a trajectory keeps of its particles' materials, `index` [n] into the scene's in map order: nothing where their
/// types tell all, or where there are more than 4096 materials, which a file does not name.
ParticleMaterials kept_materials(const std::map<std::string, MaterialConfig>& materials, std::vector<int32_t> index);

struct Scene;
/// Those of the scene's materials that a source or an emitter is of.
std::map<std::string, MaterialConfig> materials_in_use(const Scene& scene);

}  // namespace graupel
