// Numbers of files, before anything is computed from them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/trajectory.h"

namespace graupel::experiments {

/// Throws InputError, naming `what`, frame and particle, where a position [m] of a particle in the run is not finite or
/// beyond +-1e6 m, or its velocity [m/s] or a number of its fields is not finite. The frames are those from `first` on.
void check_stored_frames(const std::vector<ParticleFrame>& frames, int64_t first, const std::string& what);

}  // namespace graupel::experiments
