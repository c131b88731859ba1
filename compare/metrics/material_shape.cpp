#include "compare/metrics/material_shape.h"

#include <algorithm>
#include <cmath>

namespace graupel::compare {

Vec3d center_of_mass(const ParticleRun& run, std::size_t frame, int32_t type, const Space& space) {
  Vec3d moment = {0, 0, 0};
  double mass = 0;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if ((type >= 0 && run.trajectory.particle_type[i] != type) || !run.is_active(frame, i)) continue;
    moment += run.position(frame)[i].cast<double>() * run.mass[i];
    mass += run.mass[i];
  }
  for (int d = 0; d < 3; ++d)
    if (space.is_periodic(d)) moment[d] = 0;
  return mass > 0 ? moment * (1 / mass) : moment;
}

double front_distance(const ParticleRun& run, std::size_t frame, int32_t type, const Vec3d& center, int vertical,
                      const Space& space) {
  std::vector<double> distance;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if ((type >= 0 && run.trajectory.particle_type[i] != type) || !run.is_active(frame, i)) continue;
    Vec3d arm = run.position(frame)[i].cast<double>() - center;
    for (int d = 0; d < 3; ++d)
      if (d == vertical || space.is_periodic(d)) arm[d] = 0;
    distance.push_back(norm(arm));
  }
  if (distance.empty()) return 0;
  std::sort(distance.begin(), distance.end());
  const double rank = 0.99 * static_cast<double>(distance.size() - 1);
  const auto below = static_cast<std::size_t>(rank);
  const auto above = std::min(below + 1, distance.size() - 1);
  return distance[below] + (rank - static_cast<double>(below)) * (distance[above] - distance[below]);
}

}  // namespace graupel::compare
