#include "compare/metrics/kinetic_energy.h"

#include <algorithm>
#include <cmath>

#include "core/parallel/parallel_for.h"

namespace graupel::compare {

std::vector<double> kinetic_energy_curve(const ParticleRun& run, const Space& space) {
  const double dt = run.trajectory.frame_time;
  std::vector<double> energy(run.predicted());
  const auto frame_energy = [&](int64_t k) {
    const auto f = static_cast<std::size_t>(k) + 1;
    double sum = 0;
    for (std::size_t i = 0; i < run.size(); ++i)
      if (run.is_active(f, i) && run.is_active(f - 1, i))
        sum += run.mass[i] *
               norm2(space.difference(run.position(f)[i].cast<double>(), run.position(f - 1)[i].cast<double>()));
    energy[k] = 0.5 * sum / (dt * dt);
  };
  parallel_for(Device::cpu, static_cast<int64_t>(energy.size()), frame_energy, Grain{1});
  return energy;
}

KineticEnergyError kinetic_energy_error(const std::vector<double>& truth, const std::vector<double>& other,
                                        double smallest) {
  const std::size_t frames = std::min(truth.size(), other.size());
  KineticEnergyError error;
  if (frames == 0) return error;
  double largest = smallest, absolute = 0, squared = 0;
  for (std::size_t f = 0; f < frames; ++f) {
    const double difference = other[f] - truth[f];
    largest = std::max(largest, truth[f]);
    absolute += std::abs(difference);
    squared += difference * difference;
  }
  error.relative = absolute / static_cast<double>(frames) / largest;
  error.mean_squared = squared / static_cast<double>(frames);
  return error;
}

}  // namespace graupel::compare
