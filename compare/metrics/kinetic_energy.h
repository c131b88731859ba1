// Kinetic energy of the frames, E_f = 1/2 sum_i m_i |x_i(f) - x_i(f-1)|^2 / dt^2 over the particles that are in the run
// in both frames, and its error.
#pragma once

#include <vector>

#include "compare/metrics/particle_run.h"
#include "compare/metrics/space.h"

namespace graupel::compare {

/// E_f [J] for f = 1..predicted.
std::vector<double> kinetic_energy_curve(const ParticleRun& run, const Space& space = {});

struct KineticEnergyError {
  double relative = 0;      ///< mean_f |E_f - E*_f| / max(max_f E*_f, smallest)
  double mean_squared = 0;  ///< mean_f (E_f - E*_f)^2 [J^2]
};
/// `smallest` [J] stands in for the energy of a truth that never moves; positive.
KineticEnergyError kinetic_energy_error(const std::vector<double>& truth, const std::vector<double>& other,
                                        double smallest);

}  // namespace graupel::compare
