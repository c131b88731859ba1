// The report's plots of the forces and torques that the matter of the truth and of runs of MPM exerts on obstacles and
// walls.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "compare/comparison.h"
#include "compare/report/plot_svg.h"

namespace graupel::compare {

/// A run's name and its forces, which may be none.
using NamedForces = std::pair<std::string, ContactForces>;

/// Magnitudes over the frames. Of one run alone a plot of forces and one of torques, with a line for each of the eight
/// obstacles and walls that bear the most; of several a plot for each of the four that bear the most in the first of
/// them, with a line a run. None where no forces are known or nothing is touched.
std::vector<Plot> force_plots(const std::vector<NamedForces>& runs);

}  // namespace graupel::compare
