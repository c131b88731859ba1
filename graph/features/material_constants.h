// Constants of materials as a network sees them: fixed functions of order 1, so that no statistics are needed.
//
// | number | feature                                    | laws                       |
// |--------|--------------------------------------------|----------------------------|
// | 0      | ln(E / 3e5 Pa); of water ln(K / 3e5 Pa)    | all but stationary         |
// | 1      | ln(1 + viscosity / 0.01 Pa s) / 3          | water                      |
// | 2      | tan(friction_angle)                        | sand                       |
// | 3      | ln(1 + cohesion / 50 Pa)                   | sand                       |
// | 4      | hardening / 10                             | snow                       |
// | 5      | critical_compression / 0.025               | snow                       |
// | 6      | critical_stretch / 0.005                   | snow                       |
//
// 0 where the law has no such constant.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "graph/config/feature_config.h"

namespace graupel::graph {

struct MaterialConstants {
  float feature[material_constant_count] = {};
};
MaterialConstants material_constants(const MaterialConfig& material);

/// Index of a particle without constants: of an obstacle.
inline constexpr int32_t no_material = -1;

/// Materials of a scene in the order of its map: a particle's index is that of its material there.
class MaterialTable {
 public:
  explicit MaterialTable(const Scene& scene);

  /// Indices of particles by their types [n], for scenes where no two materials share a law. Throws ConfigError naming
  /// the materials where particles' types do not tell them, InputError for a type without material.
  std::vector<int32_t> by_type(const std::vector<int32_t>& particle_type) const;
  /// [materials] in the memory of `device`; valid as long as this or a copy lives.
  const MaterialConstants* constants(Device device) const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace graupel::graph
