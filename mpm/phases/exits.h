// How particles come into a run and leave it, and how a periodic wall takes them to its partner: for the solver's
// particles and for tracers.
#pragma once

#include "mpm/phases/phases.h"

namespace graupel::mpm {

/// Whether a particle of this time of birth [s] appears in the substep of `dt`. It starts where it would be had it
/// moved since then: x is backed off by the part of the substep before its birth, so that the step that follows takes
/// it there.
template <typename T>
GRAUPEL_HD inline bool appears(const SolverView<T>& view, double birth_time, T dt, const Vec<T, 3>& v, Vec<T, 3>& x) {
  const double age = view.lifecycle.step_end - birth_time;
  if (!(age >= 0)) return false;
  x = x + (static_cast<T>(age) - dt) * v;
  return true;
}

/// Whether particles may leave at all, or pass a periodic wall.
template <typename T>
GRAUPEL_HD inline bool has_exits(const SolverView<T>& view) {
  return view.walls.has_gates || view.lifecycle.sink_count > 0;
}

/// Takes x through a periodic wall; true when it passed an open one or entered a sink.
template <typename T>
GRAUPEL_HD inline bool leaves(const SolverView<T>& view, Vec<T, 3>& x) {
  const WallView<T>& walls = view.walls;
  bool out = false;
  for (int d = 0; d < 3; ++d) {
    const bool below = x[d]<walls.gate_low[d], above = x[d]> walls.gate_high[d];
    const T period = static_cast<T>(walls.periodic[d].cells) * view.grid.dx;
    if (below) x[d] += period;
    if (above) x[d] -= period;
    out = out || ((below || above) && walls.periodic[d].cells == 0);
  }
  for (int32_t s = 0; s < view.lifecycle.sink_count; ++s)
    out = out || view.lifecycle.sinks[s].contains(x.template cast<double>());
  return out;
}

}  // namespace graupel::mpm
