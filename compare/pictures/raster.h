// Pictures of particles: shaded spheres drawn as sprites with a depth buffer, shadows from a light-space depth map, and
// eye-dome lighting (Boucheny 2009: darker where neighbouring pixels are nearer), which shows depth without textures.
#pragma once

#include <cstdint>
#include <vector>

#include "compare/pictures/backdrop.h"
#include "compare/pictures/image.h"
#include "core/math/vec.h"

namespace graupel::compare {

/// Colour of a particle type: water blue, sand ochre, snow white, jelly green, ...
Color color_of_type(int32_t type);

/// Radius of the spheres for particles of a volume [m^3]: neighbours in a full cell touch.
double sphere_radius(double volume);

/// Draws the particles over the backdrop. `radius` [m] is the same for all of them.
Image draw_particles(const Backdrop& backdrop, const std::vector<Vec3f>& position, const std::vector<int32_t>& type,
                     double radius);

}  // namespace graupel::compare
