// Clumps of a material: connected components of its particles, two of which are linked when no farther apart than a
// radius (friends of friends, Davis et al. 1985), and the distribution of the material's mass over clumps by size.
#pragma once

#include <vector>

#include "compare/metrics/space.h"
#include "compare/metrics/wasserstein.h"
#include "core/math/vec.h"

namespace graupel::compare {

/// Linking length, in grid spacings: eight particles a cell are half a spacing apart, and a gap of more than one
/// spacing is one that a node of the grid would see.
inline constexpr double clump_radius = 1;

/// Mass of every clump [kg], in the order of its first particle. `position` [n] in m, `radius` > 0 in m. Particles are
/// linked across periodic walls too.
std::vector<double> clump_masses(const std::vector<Vec3f>& position, const std::vector<double>& mass, double radius,
                                 const Space& space = {});

/// Share of the mass in clumps by size: values log10(clump mass / `unit`), weights clump masses. A distance of 1
/// between two such distributions is that of all mass in clumps ten times as large; the logarithm, since a lump that
/// breaks in two matters as much where lumps are small.
Distribution clump_sizes(const std::vector<double>& clump_mass, double unit);

}  // namespace graupel::compare
