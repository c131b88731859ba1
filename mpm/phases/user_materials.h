// Materials with laws of the caller's own: their deformation and stress, and what they add to step statistics. On the
// CPU, in any precision; the laws see f64.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mpm/materials/user_material.h"
#include "mpm/particles/host_particles.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// [materials] of a run; null where the law is one of mpm/materials/list.h. Empty: all are.
using UserLaws = std::vector<std::shared_ptr<const UserMaterial>>;

/// What the solver's own tables say of a material with a user's law: it keeps F and the internal variable and has
/// neither stiffness nor energy.
MaterialConfig carrier_of(const MaterialConfig& material);
/// The scene with carriers in place of the `laws`.
Scene with_carriers(Scene scene, const UserMaterials& laws);

/// Laws in the order of `names`. Throws ConfigError for a law of a material that is not among them, a null pointer, and
/// a sound speed at rest that is not above 0.
UserLaws laws_of(const std::vector<std::string>& names, const UserMaterials& laws);

/// update_deformation() where some particles follow `laws`. Throws what the laws throw: of the lowest slots.
template <typename T>
void update_deformation(const SolverView<T>& view, T dt, const UserLaws& laws);

/// Adds the particles' sound speeds, and those above a cell in `dt` [s], to `found`.
template <typename T>
void add_user_statistics(const SolverView<T>& view, T dt, const UserLaws& laws, StepStatistics& found);

/// Elastic energy [J] of the particles with user's laws that are `active` (by source index; empty: all are).
template <typename T>
double user_energy(const HostParticles<T>& particles, const UserLaws& laws, const std::vector<uint8_t>& active);

}  // namespace graupel::mpm
