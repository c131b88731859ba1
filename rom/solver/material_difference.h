// How much of a body has other materials than that of the training. Nothing in a reduced run depends on the materials
// once it has started (stress is decoded), so it cannot see this by itself.
#pragma once

#include "core/scene/scene.h"
#include "mpm/sampling.h"

namespace graupel::rom {

/// Mean over the particles, weighted by volume, of how differently the two materials answer a probe (stretch, shear and
/// compression by a few per cent: |tau - tau'| over the larger one, or the difference of density if that is larger);
/// 0: the same, 1: nothing in common. `particles` and `other_particles` are the same particles.
double material_difference(const Scene& scene, const mpm::SampledParticles& particles, const Scene& other,
                           const mpm::SampledParticles& other_particles);

}  // namespace graupel::rom
