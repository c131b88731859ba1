// Scripts that lead particles: those of bodies and of regions.
#pragma once

#include <algorithm>

#include "core/scene/scene.h"

namespace graupel {

/// Whether some particles of the scene follow a script, at least until it releases them.
inline bool has_scripts(const Scene& scene) {
  return !scene.kinematic_regions.empty() ||
         std::any_of(scene.sources.begin(), scene.sources.end(), [](const Source& s) { return s.motion.has_value(); });
}

}  // namespace graupel
