// What every step of a reduced-order model adds to an instance's state, whatever its fit: residuals, counters, and
// whether blocks are to be marked anew.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

/// A struct by words of eight bytes, by a block.
template <typename Block, typename T>
GRAUPEL_HD void copy_words(const Block& block, const T& from, T& to) {
  static_assert(sizeof(T) % 8 == 0 && alignof(T) == 8);
  for (int i = block.thread(); i < static_cast<int>(sizeof(T) / 8); i += block.threads())
    __builtin_memcpy(reinterpret_cast<char*>(&to) + 8 * i, reinterpret_cast<const char*>(&from) + 8 * i, 8);
}

/// Whether so many samples are lost that the step failed, which the state then says.
template <typename Block>
GRAUPEL_HD bool lost_too_many(const Block& block, const InstanceView& instance, int samples) {
  if (2 * instance.ways->lost <= samples) return false;
  if (block.thread() == 0) instance.state->status = RunStatus::samples_lost;
  return true;
}

/// The frame's largest residual, relative to the way of the samples, and its sums; one thread. `left2`: sum of the
/// squares of the distances that are left, times the weights, whose sum is `total`.
GRAUPEL_HD inline void take_residual(InstanceState& state, const WaySums& ways, double left2, double total, int samples,
                                     double dx, double condition) {
  const double least = 1e-4 * dx, way2 = ways.moved2 / samples;
  const double residual =
      std::sqrt((left2 > 0 ? left2 : 0.0) / (total * (way2 > least * least ? way2 : least * least)));
  state.residual = residual > state.residual ? residual : state.residual;
  state.down_weighted += static_cast<double>(ways.lost) / samples;
  state.condition = condition > state.condition ? condition : state.condition;
}

/// Counters, and whether blocks are to be marked anew; one thread.
GRAUPEL_HD inline void count_step(InstanceState& state, const WaySums& ways, double dx) {
  state.points_sum += state.point_count;
  state.most_points = state.point_count > state.most_points ? state.point_count : state.most_points;
  ++state.steps;
  ++state.step;
  float furthest2;
  __builtin_memcpy(&furthest2, &ways.furthest, sizeof furthest2);
  state.moved += static_cast<double>(std::sqrt(furthest2));
  // A sample and a point may move towards each other.
  state.due = 2 * state.moved > dx ? 1 : 0;
  if (state.due == 0) return;
  ++state.round;
  state.moved = 0;
  state.block_count = state.point_count = state.group_count = 0;
}

}  // namespace graupel::rom::device
