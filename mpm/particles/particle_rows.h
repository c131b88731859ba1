// One quantity of all particles as rows in the order of the sources, in the memory of their own device. The solvers
// keep tiles in an order of their own, so rows are gathered.
#pragma once

#include <memory>
#include <vector>

#include "core/scene/particle_quantity.h"
#include "mpm/particles/particles.h"

namespace graupel::mpm {

/// [n, components_of(what)], with the values of ParticleFrame and fields_of(); complete when this returns. Particles
/// that are not `active` (by source index; empty: all are) have no velocity, stress and affine velocity.
template <typename T>
std::shared_ptr<const float> gather_rows(Particles<T>& particles, ParticleQuantity what,
                                         const std::vector<uint8_t>& active);

}  // namespace graupel::mpm
