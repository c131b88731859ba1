// Particles where they must not be: inside obstacles, beyond the walls, outside the domain.
#pragma once

#include <cstdint>

#include "compare/metrics/particle_run.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::compare {

/// Over all predicted frames and the particles that are in the run in each, with moving obstacles where they are in the
/// frame. Depth is max(0, -phi), at most the obstacles' narrow band. Open and periodic walls hold nothing.
struct Containment {
  double mean_depth = 0;            ///< [m], over all particles, those outside counting 0
  double max_depth = 0;             ///< [m]
  double inside_share = 0;          ///< of particle-frames deeper than 1e-3 dx
  double outside_walls = 0;         ///< share of particle-frames more than 1e-3 dx beyond the holding walls
  int64_t most_outside_domain = 0;  ///< largest number of particles outside the domain in one frame
};

Containment containment(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const ParticleRun& run);

/// Distance [m] of each particle to the nearest obstacle or holding wall, negative beyond it; at most the band.
std::vector<double> clearances(const Scene& scene, const sparsegrid::ObstacleSet& obstacles,
                               const std::vector<Vec3f>& position);

}  // namespace graupel::compare
