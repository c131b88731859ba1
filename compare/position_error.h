// Position error of a run: mean squared distance between each particle and its counterpart.
//   e_f = 1/N sum_i |x_i(f) - x*_i(f)|^2 (axes summed), MSE_n = 1/n sum_{f=1..n} e_f
// LagrangeBench (Toshev et al. 2023) gives the mean over axes as well, and over all particles, also those held.
#pragma once

#include <cstdint>
#include <vector>

#include "compare/particle_run.h"

namespace graupel::compare {

/// Counterpart in `run` of every particle of `truth`: particle i itself when counts and types agree, otherwise the
/// nearest particle of the same type in frame 0 (the lower index on a tie). Throws InputError when a type is missing.
std::vector<int32_t> counterparts(const ParticleRun& truth, const ParticleRun& run);

/// Where the run puts the particles of the truth in frame f: x*_i(0) + x_c(f) - x_c(0) with c the counterpart, which is
/// x_i(f) itself when both runs have the same particles. A coarse particle thus carries the fine ones nearest to it.
std::vector<Vec3d> carried_positions(const ParticleRun& truth, const ParticleRun& run,
                                     const std::vector<int32_t>& counterpart, std::size_t f);

/// e_f [m^2] for f = 1..predicted; `type` limits the mean to one particle type (-1: all that
/// move by themselves).
std::vector<double> position_error_curve(const ParticleRun& truth, const ParticleRun& run,
                                         const std::vector<int32_t>& counterpart, int32_t type = -1);

/// Mean of the first n entries (of all when there are fewer; 0 for an empty curve).
double mean_of_first(const std::vector<double>& curve, std::size_t n);

}  // namespace graupel::compare
