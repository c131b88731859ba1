// Positions of files, before anything is computed from them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"

namespace graupel::experiments {

/// Throws InputError, naming `what`, frame and particle, for a position [m] of a particle in the run that is not finite
/// or beyond +-1e6 m. The frames are those from `first` on.
void check_stored_positions(const std::vector<ParticleFrame>& frames, int64_t first, const std::string& what);

}  // namespace graupel::experiments
