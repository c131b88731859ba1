// Scenes that a program makes: the ranges of their declarations, which the reader of files has checked already.
#pragma once

#include "core/scene/scene.h"

namespace graupel {

/// Throws ConfigError for a number of the scene that is none, or out of its range, as "sources[0].particles_per_cell".
/// Numbers that have no effect (of another shape, policy or model) may have any value.
void check_ranges(const Scene& scene);

}  // namespace graupel
