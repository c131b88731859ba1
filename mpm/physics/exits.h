// How particles come into a run and leave it, and how a periodic wall takes them to its partner: for the solvers'
// particles and for tracers.
#pragma once

#include "mpm/grid/scene_view.h"
#include "mpm/particles/particle_lifecycle.h"

namespace graupel::mpm {

/// Whether a particle of this time of birth [s] appears in the substep of `dt` that ends at `step_end`. It starts where
/// it would be had it moved since then: x is backed off by the part of the substep before its birth, so that the step
/// that follows takes it there.
template <typename T>
GRAUPEL_HD inline bool appears(double step_end, double birth_time, T dt, const Vec<T, 3>& v, Vec<T, 3>& x) {
  const double age = step_end - birth_time;
  if (!(age >= 0)) return false;
  x = x + (static_cast<T>(age) - dt) * v;
  return true;
}

/// Whether particles may leave at all, or pass a periodic wall.
template <typename T>
GRAUPEL_HD inline bool has_exits(const WallView<T>& walls, const LifecycleView<T>& lifecycle) {
  return walls.has_gates || lifecycle.sink_count > 0;
}

/// Takes x through a periodic wall; true when it passed an open one or entered a sink.
template <typename T>
GRAUPEL_HD inline bool leaves(const WallView<T>& walls, const LifecycleView<T>& lifecycle, T dx, Vec<T, 3>& x) {
  bool out = false;
  for (int d = 0; d < 3; ++d) {
    const bool below = x[d]<walls.gate_low[d], above = x[d]> walls.gate_high[d];
    const T period = static_cast<T>(walls.periodic[d].cells) * dx;
    if (below) x[d] += period;
    if (above) x[d] -= period;
    out = out || ((below || above) && walls.periodic[d].cells == 0);
  }
  for (int32_t s = 0; s < lifecycle.sink_count; ++s)
    out = out || lifecycle.sinks[s].contains(x.template cast<double>());
  return out;
}

}  // namespace graupel::mpm
