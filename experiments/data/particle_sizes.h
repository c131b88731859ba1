// Sizes of a trajectory's particles: the edge of the cube that each fills at the start, in the plane of the square.
#pragma once

#include <vector>

#include "core/scene/trajectory.h"
#include "experiments/data/stored_scene.h"
#include "io/export/export.h"

namespace graupel::experiments {

/// [N] (V_p / k)^(1/d) [m], where V_p is the reference volume of the scene's particle, d the dimensions, and k the
/// points that the trajectory has for each particle (`rollout --refine`). Where it has other particles than the scene
/// makes, or the geometry is not there: the widest of the particle's material. Empty without a scene.
std::vector<float> particle_sizes(const StoredScene& stored, const Trajectory& header);

/// The widest of a body's particles [m].
double widest_size(const std::vector<float>& sizes, const Trajectory& header, const io::SurfaceBody& body);

}  // namespace graupel::experiments
