// Distribution of a material's local density: how thick it lies, wherever that is.
#pragma once

#include <vector>

#include "compare/metrics/space.h"
#include "compare/metrics/wasserstein.h"
#include "core/math/vec.h"

namespace graupel::compare {

/// Volume at rest is spread trilinearly to nodes `spacing` [m] apart; the values are a node's volume over that of its
/// cell, 1 for matter at rest, of the nodes above occupied_fill, each of weight 1. A single 0 where there is none.
/// `position` [n] in m, `volume` [n] in m^3; in the plane areas. Periods are whole numbers of spacings.
Distribution local_density(const std::vector<Vec3f>& position, const std::vector<double>& volume, double spacing,
                           const Space& space = {});

}  // namespace graupel::compare
