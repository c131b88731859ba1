// Where a material is: its centre of mass, and its front (run-out).
#pragma once

#include <cstdint>
#include <vector>

#include "compare/metrics/particle_run.h"

namespace graupel::compare {

/// Centre of mass [m] of the particles of one type (-1: all) in a frame; zero without such particles.
Vec3d center_of_mass(const ParticleRun& run, std::size_t frame, int32_t type = -1);

/// 99th percentile over the particles of a type of the horizontal distance to `center` [m]; 0 without such particles.
/// Linear interpolation between order statistics; `vertical` is the axis left out.
double front_distance(const ParticleRun& run, std::size_t frame, int32_t type, const Vec3d& center, int vertical);

}  // namespace graupel::compare
