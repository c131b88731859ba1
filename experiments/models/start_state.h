// The particles of a scene at its start, and scenes that start from given particles.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/scene.h"
#include "mpm/sampling.h"

namespace graupel::experiments {

/// Particles at the start of a scene, with the mass and volume of each.
struct StartState {
  std::vector<int32_t> particle_type;
  std::vector<Vec3f> position;       ///< [m]
  std::vector<Vec3f> velocity;       ///< [m/s]
  std::vector<double> mass, volume;  ///< [kg], [m^3]
  std::vector<double> birth_time;  ///< [s]; those after 0 have the place and the velocity of it; empty without emitters
};
StartState start_of(const Scene& scene, uint64_t seed);

/// Moves each particle's start, or place of birth, by `distance` [m] in a random direction, but not beyond the walls.
void move_births(const Scene& scene, uint64_t seed, double distance, mpm::SampledParticles& particles);

/// The scene with its particles as points at `position` [particles], at rest: a late state, without its stresses.
Scene resting_scene(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& position);

}  // namespace graupel::experiments
