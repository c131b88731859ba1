#include "compare/metrics/position_error.h"

#include <algorithm>
#include <numeric>

#include "core/parallel/parallel_for.h"
#include "core/scene/kinematic_particles.h"
#include "core/system/error.h"

namespace graupel::compare {

bool same_particles(const ParticleRun& truth, const ParticleRun& run) {
  return truth.trajectory.particle_type == run.trajectory.particle_type;
}

std::vector<double> position_error_curve(const ParticleRun& truth, const ParticleRun& run, int32_t type,
                                         const Space& space) {
  if (!same_particles(truth, run))
    throw InputError("a run has other particles than the truth (" + std::to_string(run.size()) + ", " +
                     std::to_string(truth.size()) +
                     " in the truth, or of other types). Use runs of one scene and seed");
  const std::size_t frames = std::min(truth.predicted(), run.predicted());
  std::vector<double> curve(frames);
  const auto frame_error = [&](int64_t k) {
    const std::size_t f = static_cast<std::size_t>(k) + 1;
    double sum = 0;
    int64_t n = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const int32_t own = truth.trajectory.particle_type[i];
      if (type >= 0 ? own != type : !moves_by_itself(own)) continue;
      if (!truth.is_active(f, i) || !run.is_active(f, i)) continue;
      sum += norm2(space.difference(run.position(f)[i].cast<double>(), truth.position(f)[i].cast<double>()));
      ++n;
    }
    curve[k] = n > 0 ? sum / static_cast<double>(n) : 0;
  };
  parallel_for(Device::cpu, static_cast<int64_t>(frames), frame_error, Grain{1});
  return curve;
}

double mean_of_first(const std::vector<double>& curve, std::size_t n) {
  n = std::min(n, curve.size());
  if (n == 0) return 0;
  return std::accumulate(curve.begin(), curve.begin() + static_cast<std::ptrdiff_t>(n), 0.0) / static_cast<double>(n);
}

}  // namespace graupel::compare
