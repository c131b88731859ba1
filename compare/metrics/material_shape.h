// Where a material is: its centre of mass, and its front (run-out).
#pragma once

#include <cstdint>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "compare/metrics/space.h"

namespace graupel::compare {

/// Centre of mass [m] of the particles of one type (-1: all) that are in the run in a frame; zero without such
/// particles, and along periodic axes, where none is defined.
Vec3d center_of_mass(const ParticleRun& run, std::size_t frame, int32_t type = -1, const Space& space = {});

/// 99th percentile over the particles of a type that are in the run of the horizontal distance to `center` [m]; 0
/// without such particles. Linear interpolation between order statistics; `vertical` and periodic axes are left out.
double front_distance(const ParticleRun& run, std::size_t frame, int32_t type, const Vec3d& center, int vertical,
                      const Space& space = {});

}  // namespace graupel::compare
