// Copies of particles beyond periodic walls, so that what looks at neighbours finds those across a wall.
#pragma once

#include <cstdint>
#include <vector>

#include "graph/features/features.h"

namespace graupel::graph {

/// Image k is particle source[k], moved by shift[k] [m].
struct PeriodicImages {
  std::vector<int32_t> source;
  std::vector<Vec3f> shift;
};

/// Images of particles at `position` [n] that lie within `layer` [m] of the periodic walls, outside of them; at most
/// one on each side of an axis, and those of corners. Empty without periodic walls.
PeriodicImages periodic_images(const Environment& environment, const std::vector<Vec3f>& position, double layer);

/// Moves older positions by whole periods, so that no particle of `positions` (frames [n], newest last) goes farther
/// than half a period between two frames.
void unwrap_periodic(const Environment& environment, std::vector<std::vector<Vec3f>>& positions);

}  // namespace graupel::graph
