// What of a scene with two dimensions leads out of its plane.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace graupel {

/// A key of a scene whose value does not lie in the plane.
struct OutOfPlane {
  std::vector<std::string> path;  ///< keys and indices down to it
  std::string problem, remedy;
};

/// The first one; none for scenes with three dimensions. Velocities and forces have no z, spins and turns are about z;
/// shapes may have any pose: the plane cuts them.
std::optional<OutOfPlane> first_out_of_plane(const Scene& scene);

}  // namespace graupel
