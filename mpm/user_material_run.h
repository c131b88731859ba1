// Runs of the solver with constitutive laws of the caller's own.
#pragma once

#include <memory>

#include "mpm/materials/user_material.h"
#include "mpm/simulation.h"

namespace graupel::mpm {

/// Simulation::create() with laws in place of those of the scene's materials. Particles of these have an internal
/// variable of the law's own in ParticleField::plastic. Saved states do not hold the laws: the caller gives the same
/// again. Throws ConfigError for a law of a material that no particle could have, and on a GPU.
std::unique_ptr<Simulation> create_with_user_materials(const PreparedScene& prepared, const UserMaterials& laws);

}  // namespace graupel::mpm
