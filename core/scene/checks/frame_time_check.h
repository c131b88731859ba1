// Whether the frames of a file are those of its scene.
#pragma once

#include <cmath>
#include <string>

#include "core/system/error.h"

namespace graupel {

/// Throws InputError where the frames of `what` are `stored` seconds apart and those of its scene are not: `rollout
/// --stride` keeps every n-th alone, and frame i is then not the scene's frame i.
inline void check_frame_time(double stored, double of_scene, const std::string& what) {
  if (std::abs(stored - of_scene) <= 1e-6 * of_scene) return;
  throw InputError(what + " has frames " + std::to_string(stored) + " s apart, where its scene has one every " +
                   std::to_string(of_scene) + " s, as of rollout --stride. Make it again, with all frames");
}

}  // namespace graupel
