// The report's plots of the forces and torques that the truth's matter exerts on obstacles and walls.
#pragma once

#include <vector>

#include "compare/comparison.h"
#include "compare/report/plot_svg.h"

namespace graupel::compare {

/// Magnitudes over the frames, of the eight obstacles and walls that bear the most; none where no forces are known or
/// nothing is touched.
std::vector<Plot> force_plots(const ContactForces& forces);

}  // namespace graupel::compare
