// How dense a scene's matter is at rest, as the density projection holds it to.
#pragma once

#include <vector>

#include "core/scene.h"
#include "core/vec.h"

namespace graupel::graph {

/// Particles per m^3: the larger of what the scene's sources say (the densest one's particles_per_cell / dx^3) and of
/// what half of the particles at the start have around them at least, counted in cells of edge `spacing` [m]. Sources
/// of converted data sets are boxes around scattered matter, or there are none. 0 without particles and sources.
double rest_density(const Scene& scene, const std::vector<Vec3f>& start, double spacing);

}  // namespace graupel::graph
