// Motion of particles away from walls and obstacles, their owner blocks, and the step_statistics of the new state.
// Equals move_point() and the step_statistics of mpm/physics/particle_motion.h where nothing is in the way; its gain is
// in that of the whole pass (docs/decisions/0006-cpu-tuning.md).
#pragma once

#include "mpm/cpu/lanes_materials.h"
#include "mpm/cpu/lanes_place.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm {
namespace {

template <typename T>
struct LaneMotion {
  Lanes<T> v[3];
  LaneMatrix<T> C;
};

/// Directory index of the blocks that hold the nodes `cells` counted from node 0, rounded down.
template <typename T>
GRAUPEL_LANES Ints<T> directory_index(const CpuStep<T>& s, const Lanes<T> (&cells)[3]) {
  Ints<T> index = Ints<T>{};
  for (int d = 0; d < 3; ++d) index = index * s.blocks[d] + __builtin_convertvector(cells[d], Ints<T>) / block_width;
  return index;
}

/// x <- x + dt v, and the owner blocks of that. False, with nothing done, where a lane meets a wall, may meet an
/// obstacle, or goes too far: that is for the general code.
template <typename T>
GRAUPEL_LANES bool move(const CpuStep<T>& s, int64_t tile_index, int lane, const LaneMotion<T>& motion) {
  Lanes<T> x[3], cells[3];
  Mask<T> simple = Mask<T>{} - 1;
  for (int d = 0; d < 3; ++d) {
    const Lanes<T> step = s.dt * motion.v[d];
    x[d] = component<T, 3>(s.position, tile_index, d, lane) + step;
    simple &= within_a_cell(Pack<T>(step), s.dx).m & (x[d] >= s.particle_low[d]) & (x[d] <= s.particle_high[d]);
    cells[d] = (x[d] - s.origin[d]) * s.inverse_dx + T(0.5);
  }
  if (any(~simple)) return false;
  if (s.surface_blocks != nullptr) {
    const Ints<T> nearest = directory_index(s, cells);
    int32_t near = -1;
    for (int l = 0; l < width<T>; ++l) near &= s.surface_blocks[nearest[l]];
    if (near >= 0) return false;
  }
  for (int d = 0; d < 3; ++d) {
    set_component<T, 3>(s.position, tile_index, d, lane, x[d]);
    cells[d] -= T(1);
  }
  int32_t* keys = s.keys + tile_index * tile_lanes + lane;
  const Ints<T> owner = directory_index(s, cells);
  if (any(owner != load_as<Ints<T>>(keys))) {
    store(keys, owner);
    __atomic_store_n(s.keys_changed, uint8_t(1), __ATOMIC_RELAXED);
  }
  return true;
}

template <typename T>
struct LaneStepStatistics {
  Lanes<T> speed2 = Lanes<T>{}, sound_speed = Lanes<T>{};
  Mask<T> over_courant = Mask<T>{};  ///< minus their number

  GRAUPEL_LANES_MEMBER void add_to(StepStatistics& found) const {
    const double v2 = static_cast<double>(largest_of<T>(speed2)), c = static_cast<double>(largest_of<T>(sound_speed));
    if (v2 > found.largest_speed2) found.largest_speed2 = v2;
    if (c > found.largest_sound_speed) found.largest_sound_speed = c;
    for (int l = 0; l < width<T>; ++l) found.over_courant -= over_courant[l];
  }
};

/// False, with nothing counted, where a lane is bad.
template <typename T, bool volume_ratio>
GRAUPEL_LANES bool survey_lanes(const CpuStep<T>& s, const LaneMotion<T>& motion, const LaneState<T>& state,
                                LaneStepStatistics<T>& step_statistics) {
  const Lanes<T> speed2 = motion.v[0] * motion.v[0] + motion.v[1] * motion.v[1] + motion.v[2] * motion.v[2];
  const Mask<T> internal_is_good = volume_ratio ? state.internal > T(0) : state.internal == state.internal;
  if (any(~((speed2 < T(1e30)) & internal_is_good))) return false;
  step_statistics.speed2 = larger(speed2, step_statistics.speed2);
  step_statistics.sound_speed = larger(state.sound_speed, step_statistics.sound_speed);
  step_statistics.over_courant += state.sound_speed * s.dt > s.dx;
  return true;
}

}  // namespace
}  // namespace graupel::mpm
