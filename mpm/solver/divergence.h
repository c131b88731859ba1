// The error that ends a run which blew up: which particle, what happened to it, and a step to try, or
// which parameter leaves none.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "mpm/solver/time_step.h"

namespace graupel::mpm {

/// The fastest elastic wave of materials that are at rest.
struct RestingWave {
  double speed = 0;      ///< [m/s]
  std::string material;  ///< whose it is
};
RestingWave fastest_at_rest(const std::vector<MaterialConfig>& materials);

struct DivergedParticle {
  int64_t index = 0;                                          ///< in the order of the sources
  double speed = 0;                                           ///< [m/s]
  double internal = 0;                                        ///< its internal variable (mpm/materials/material.h)
  int64_t substeps = 0;                                       ///< done in the run
  double time = 0, dt = 0;                                    ///< [s]
  StateSpeeds before;                                         ///< of the state before the substep
  RestingWave wave;                                           ///< of all materials of the run
  double largest_number = std::numeric_limits<float>::max();  ///< in the run's precision
};

/// Throws DivergedError.
[[noreturn]] void throw_diverged(const Scene& scene, const MaterialConfig& material, const DivergedParticle& particle);

}  // namespace graupel::mpm
