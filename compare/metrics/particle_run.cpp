#include "compare/metrics/particle_run.h"

#include <cmath>
#include <set>

namespace graupel::compare {

std::vector<int32_t> types_of(const Trajectory& trajectory) {
  const std::set<int32_t> types(trajectory.particle_type.begin(), trajectory.particle_type.end());
  return {types.begin(), types.end()};
}

bool ParticleRun::has_type(std::size_t f, int32_t type) const {
  for (std::size_t i = 0; i < size(); ++i)
    if (trajectory.particle_type[i] == type && is_active(f, i)) return true;
  return false;
}

void hold_last_frame(Trajectory& trajectory, std::size_t frames) {
  while (trajectory.frames.size() < frames + 1) {
    ParticleFrame frame = trajectory.frames.back();
    frame.time += trajectory.frame_time;
    trajectory.frames.push_back(std::move(frame));
  }
}

int vertical_axis(const Vec3d& gravity) {
  int axis = 1;
  for (int d = 0; d < 3; ++d)
    if (std::abs(gravity[d]) > std::abs(gravity[axis])) axis = d;
  return axis;
}

}  // namespace graupel::compare
