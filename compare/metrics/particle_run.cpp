#include "compare/metrics/particle_run.h"

#include <cmath>
#include <set>

namespace graupel::compare {

std::vector<int32_t> types_of(const Trajectory& trajectory) {
  const std::set<int32_t> types(trajectory.particle_type.begin(), trajectory.particle_type.end());
  return {types.begin(), types.end()};
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
