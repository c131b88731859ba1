// Particles whose places are given in every frame: those of obstacles, which other programs' data sets have, and those
// of the material "stationary". Others meet them; nothing is predicted of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/scene/material_config.h"

namespace graupel {

inline bool moves_by_itself(int32_t particle_type) {
  return particle_type != obstacle_particle_type && particle_type != particle_type_of(MaterialModel::stationary);
}

/// [n] 1 for kinematic particles; empty where there are none.
inline std::vector<uint8_t> kinematic_mask(const std::vector<int32_t>& particle_type) {
  std::vector<uint8_t> kinematic;
  kinematic.reserve(particle_type.size());
  for (const int32_t type : particle_type) kinematic.push_back(moves_by_itself(type) ? 0 : 1);
  if (std::find(kinematic.begin(), kinematic.end(), 1) == kinematic.end()) kinematic.clear();
  return kinematic;
}

}  // namespace graupel
