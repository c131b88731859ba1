// Places particles in the sources of a scene.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene.h"

namespace graupel::mpm {

/// Particles at the start, source by source. Depends on (seed, source index, particle index) alone.
struct SampledParticles {
  std::vector<Vec3d> position;              ///< [m]
  std::vector<Vec3d> velocity;              ///< [m/s]
  std::vector<double> volume;               ///< reference volume dx^3 / particles_per_cell [m^3]
  std::vector<int32_t> material;            ///< index into material_names
  std::vector<int32_t> source;              ///< index into scene.sources
  std::vector<std::string> material_names;  ///< keys of scene.materials, in map order
};

SampledParticles sample_sources(const Scene& scene, uint64_t seed);

}  // namespace graupel::mpm
