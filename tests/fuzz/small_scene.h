// Which scenes a fuzz target sets up.
#pragma once

#include "mpm/memory_need.h"

namespace graupel::fuzz {

/// Whether a few milliseconds are enough to set the scene up.
inline bool is_small(const Scene& scene) {
  const mpm::MemoryNeed need = mpm::least_memory(scene, {});
  return need.particles < 300 && need.blocks <= 4096 && scene.obstacles.empty();
}

}  // namespace graupel::fuzz
