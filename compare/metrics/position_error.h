// Position error of a run: mean squared distance between each particle and the same one of the truth.
//   e_f = 1/N sum_i |x_i(f) - x*_i(f)|^2 (axes summed), MSE_n = 1/n sum_{f=1..n} e_f
// over the N particles that are in both runs in frame f; e_f = 0 where there are none.
// LagrangeBench (Toshev et al. 2023) gives the mean over axes as well, and over all particles, also those held.
#pragma once

#include <cstdint>
#include <vector>

#include "compare/metrics/particle_run.h"
#include "compare/metrics/space.h"

namespace graupel::compare {

/// Whether both have the same particles: as many, of the same types in the same order.
bool same_particles(const ParticleRun& truth, const ParticleRun& run);

/// e_f [m^2] for f = 1..predicted; `type` limits the mean to one particle type (-1: all that move by themselves).
/// Throws InputError for runs of other particles.
std::vector<double> position_error_curve(const ParticleRun& truth, const ParticleRun& run, int32_t type = -1,
                                         const Space& space = {});

/// Mean of the first n entries (of all when there are fewer; 0 for an empty curve).
double mean_of_first(const std::vector<double>& curve, std::size_t n);

}  // namespace graupel::compare
