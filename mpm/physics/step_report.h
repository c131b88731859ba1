// What one pass over the particles tells about the state of a run.
#pragma once

#include <cstdint>

#include "core/parallel/host_device.h"

namespace graupel::mpm {

/// What a pass over some particles found. Sums are added and bounds are merged in a fixed order.
struct StepStatistics {
  double largest_speed2 = 0;       ///< of finite velocities [m^2/s^2]
  double largest_sound_speed = 0;  ///< [m/s]
  int64_t over_courant = 0;        ///< particles with c dt / dx > 1
  int64_t bad_slot = -1;           ///< lowest slot with NaN, J <= 0 or a move over one cell
  int64_t pushed_out = 0;
  double pushed_momentum[3] = {0, 0, 0};  ///< [kg m/s]
  int64_t born = 0, removed = 0;          ///< particles that came and went

  GRAUPEL_HD void merge(const StepStatistics& o) {
    largest_speed2 = o.largest_speed2 > largest_speed2 ? o.largest_speed2 : largest_speed2;
    largest_sound_speed = o.largest_sound_speed > largest_sound_speed ? o.largest_sound_speed : largest_sound_speed;
    over_courant += o.over_courant;
    if (o.bad_slot >= 0 && (bad_slot < 0 || o.bad_slot < bad_slot)) bad_slot = o.bad_slot;
    pushed_out += o.pushed_out;
    born += o.born;
    removed += o.removed;
    for (int d = 0; d < 3; ++d) pushed_momentum[d] += o.pushed_momentum[d];
  }
};

}  // namespace graupel::mpm
