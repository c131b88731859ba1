// How dense a scene's matter is at rest, as the density projection holds it to.
#pragma once

#include <vector>

#include "core/math/vec.h"
#include "core/scene/scene.h"

namespace graupel::graph {

/// Particles per m^3: what the densest source or emitter says (particles_per_cell / dx^3), or, where that is more, what
/// half of the particles at the start have around them at least, counted in cells of edge `spacing` [m]: sources of
/// converted data sets are boxes around scattered matter. Without sources, what a tenth of the particles have; 0
/// without particles.
double rest_density(const Scene& scene, const std::vector<Vec3f>& start, double spacing);

}  // namespace graupel::graph
