// Checks that a scene's particles can start where their sources put them.
#pragma once

#include "mpm/sampling.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

/// Throws ConfigError for a number of dimensions other than 2 and 3, and when something leads out of the plane of a
/// scene with two.
void check_plane(const Scene& scene);

/// What check_obstacles() finds without level sets, which take milliseconds each: obstacles at rest given by formulas.
void check_shapes_of_obstacles(const Scene& scene);

/// Throws ConfigError for an obstacle, other than a plane, that is outside the domain at the start and never comes in.
void check_obstacles(const Scene& scene, const sparsegrid::ObstacleSet& obstacles);

/// Throws ConfigError as check_obstacles() does, when there is no particle, when one lies outside the walls (naming the
/// source and the allowed box) or inside an obstacle (naming both), and when a script leads one out of the walls.
void check_start(const Scene& scene, const SampledParticles& particles, const sparsegrid::ObstacleSet& obstacles);

}  // namespace graupel::mpm
