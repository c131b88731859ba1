// Starts a run from particles of the caller's own: positions, velocities, deformation gradients, materials from arrays.
#pragma once

#include "core/scene/particle_state.h"
#include "core/scene/scene.h"
#include "core/system/error.h"

namespace graupel {

/// The scene with these particles in place of its sources, in their order, for Simulation and NetworkModel::rollout().
/// Emitters, regions and obstacles stay. `particles_per_cell` becomes that of the mean volume, 1000 at most. In two
/// dimensions the third coordinate of positions is set to the plane's. With positions, velocities and all fields of a
/// stored frame a run goes on from there, to the rounding of what is stored. Throws ConfigError, with the number of the
/// first bad particle, its value and what is allowed: for lists of another length than the positions, numbers that are
/// not finite, positions out of the walls, det F <= 0, in two dimensions F or C that lead out of the plane, volumes <=
/// 0 and unknown materials. Inside of obstacles the run itself refuses particles.
Scene with_particles(const Scene& scene, ParticleState state);

}  // namespace graupel
