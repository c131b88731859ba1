// Checks what a saved state says of the particles: its checksum may be right over anything.
#pragma once

#include <vector>

#include "core/scene/domain.h"
#include "mpm/particles/host_particles.h"
#include "mpm/particles/particle_lifecycle.h"

namespace graupel::mpm {

/// Throws InputError, naming a slot, for what no run leaves: material numbers beyond `materials`, an order that is no
/// permutation, an unknown presence ([particles], empty: all are there), a particle outside of the box or state that is
/// not finite.
template <typename T>
void check_state(const HostParticles<T>& particles, const std::vector<Presence>& presence, int32_t materials,
                 const Domain& box);

}  // namespace graupel::mpm
