// The last kernel of a reduced-order model's step: the latent that fits the samples' ways best (the problem and its
// solution for any ways: rom/cuda/device_equations.h), a block an instance. A part of the way back to the training's
// curve follows, without a change of velocity. The next step waits for this kernel: what does not depend on each other
// is done by different warps at once.
#pragma once

#include "rom/cuda/device_equations.h"
#include "rom/cuda/device_state.h"
#include "rom/projection/latent_state.h"

namespace graupel::rom::device {

inline constexpr int curve_parts = 2 * curve_window + 1;

struct FitShared {
  InstanceState state;  ///< at work; written back in the end
  WaySums ways;
  double change[most_closure_latents];                             ///< dq
  double seen[most_closure_latents];                               ///< S^T U^T way
  double latent[most_closure_latents];                             ///< q* + dq
  double along;                                                    ///< d^T U^T way
  double curve[(curve_parts + 1) * most_closure_latents];          ///< around the present
  double way[most_closure_latents];                                ///< of the way back that the step takes
  double part_distance2[curve_parts], part_fraction[curve_parts];  ///< of parts of the curve
  int failed;
};

template <typename Block>
struct Fit {
  const Block& block;
  const RunView& view;
  const ModelView& model;
  const InstanceView& instance;
  FitShared& shared;
  EquationCapacity room;  ///< slope: S; turned: P
  double inverse_dt;      ///< [1/s]

  /// f(i) for i = 0 .. n - 1, by the threads of the block from thread `first` on.
  template <typename F>
  GRAUPEL_HD void each(int n, const F& f, int first = 0) const {
    for (int i = block.thread() - first; i < n; i += block.threads())
      if (i >= 0) f(i);
  }

  /// G without the samples that are lost.
  GRAUPEL_HD void leave_out_lost() const {
    const int m = model.deformation_modes;
    each(m * m, [&](int i) {
      const float* const a = model.sample_modes + int64_t(i / m) * model.sample_rows;
      const float* const b = model.sample_modes + int64_t(i % m) * model.sample_rows;
      double sum = model.gram[i];
      for (int s = 0; s < model.samples; ++s)
        if (instance.lost[s] != 0)
          for (int c = 0; c < 3; ++c) sum -= static_cast<double>(a[3 * s + c]) * static_cast<double>(b[3 * s + c]);
      instance.gram[i] = sum;
    });
    block.sync();
  }

  /// First part of the curve that may be the nearest.
  GRAUPEL_HD int first_part(int64_t steps) const {
    const auto curve_index = static_cast<int32_t>(static_cast<double>(steps + 1) * view.curve_step);
    return curve_index > curve_window ? curve_index - curve_window : 0;
  }

  /// All that the step needs, into shared memory at once.
  GRAUPEL_HD void load() const {
    const int r = model.latents, m = model.deformation_modes;
    copy_words(block, *instance.state, shared.state);
    copy_words(block, *instance.ways, shared.ways);
    each(m * r, [&](int i) {
      room.slope[i] = instance.slope[i];
      room.turned[i] = instance.equations->solution[i];
    });
    if (block.thread() == 0) shared.failed = instance.equations->solved == 0 ? 1 : 0;
    each(r, [&](int j) { shared.way[j] = 0; });
    if (!(view.pull > 0)) return;
    const int first = first_part(instance.state->steps), there = (instance.curve_points - first) * r;
    each((curve_parts + 1) * r, [&](int i) {
      if (i < there) shared.curve[i] = instance.curve[int64_t(first) * r + i];
    });
  }

  /// dq, a warp a latent.
  GRAUPEL_HD void find_change() const {
    const int r = model.latents, m = model.deformation_modes;
    const int lane = block.thread() % warp_width, warps = block.threads() / warp_width;
    const double* const b = shared.ways.projection;
    for (int j = block.thread() / warp_width; j <= r; j += warps) {
      double change = 0, seen = 0;
      for (int k = lane; k < m; k += warp_width) {
        if (j < r) {
          change += room.turned[j * m + k] * b[k];
          seen += room.slope[k * r + j] * b[k];
        } else {
          seen += (instance.ahead[k] - instance.coefficient[k]) * b[k];
        }
      }
      change = sum_of_warp(block, change);
      seen = sum_of_warp(block, seen);
      if (lane != 0) continue;
      if (j == r) {
        shared.along = seen;
        continue;
      }
      change -= instance.equations->offset[j];
      shared.change[j] = change;
      shared.seen[j] = seen;
      shared.latent[j] = shared.state.latent[j] + view.dt * shared.state.velocity[j] + change;
      if (!(std::abs(change) < 1e300)) shared.failed = 1;
    }
  }

  /// The way back to the curve of the training (rom/projection/latent_manifold.h), as far as the step takes it; a part
  /// of the curve a thread, then a latent a thread.
  GRAUPEL_HD void measure_curve() const {
    const int r = model.latents, first = first_part(shared.state.steps);
    const auto curve_index = static_cast<int32_t>(static_cast<double>(shared.state.steps + 1) * view.curve_step);
    const int last = instance.curve_points - 2;
    each(curve_parts, [&](int part) {
      shared.part_distance2[part] = 1e300;
      if (first + part > (curve_index + curve_window < last ? curve_index + curve_window : last)) return;
      const double* const from = shared.curve + part * r;
      double along = 0, length2 = 0;
      for (int j = 0; j < r; ++j) {
        along += (from[r + j] - from[j]) * (shared.latent[j] - from[j]);
        length2 += (from[r + j] - from[j]) * (from[r + j] - from[j]);
      }
      double fraction = along / (length2 > 1e-300 ? length2 : 1e-300), distance2 = 0;
      fraction = fraction < 0 ? 0.0 : fraction > 1 ? 1.0 : fraction;
      for (int j = 0; j < r; ++j) {
        const double d = shared.latent[j] - from[j] - fraction * (from[r + j] - from[j]);
        distance2 += d * d;
      }
      shared.part_distance2[part] = distance2;
      shared.part_fraction[part] = fraction;
    });
  }
  GRAUPEL_HD void find_way_back() const {
    const int r = model.latents;
    each(r, [&](int j) {
      int nearest = 0;
      for (int part = 1; part < curve_parts; ++part)
        if (shared.part_distance2[part] < shared.part_distance2[nearest]) nearest = part;
      if (!(shared.part_distance2[nearest] < 1e300)) return;  // the run is longer than the training's
      const double* const from = shared.curve + nearest * r;
      const double point = from[j] + shared.part_fraction[nearest] * (from[r + j] - from[j]);
      shared.way[j] = view.pull * (point - shared.latent[j]);
    });
  }

  /// The frame's largest residual: with da = d + S dq to first order, the square of the distance that is left is
  /// way^2 - 2 (U^T way) . da + da^T G da. By a warp.
  GRAUPEL_HD void measure_residual(int lane) const {
    const int r = model.latents;
    const NormalEquations& equations = *instance.equations;
    double sum = 0;
    for (int e = lane; e < r * r; e += warp_width)
      sum += equations.matrix[e] * shared.change[e / r] * shared.change[e % r];
    for (int j = lane; j < r; j += warp_width) sum += 2 * (equations.turned[j] - shared.seen[j]) * shared.change[j];
    sum = sum_of_warp(block, sum);
    if (lane != 0) return;
    const WaySums& ways = shared.ways;
    const double left2 = sum + equations.square - 2 * shared.along + ways.moved2;
    take_residual(shared.state, ways, left2, model.samples - ways.lost, model.samples,
                  static_cast<double>(instance.scene.grid.dx), equations.condition);
  }

  /// The new latent, and the coefficients there to first order.
  GRAUPEL_HD void store() const {
    const int r = model.latents;
    each(model.deformation_modes, [&](int k) {
      double increment = instance.ahead[k] - instance.coefficient[k], back = 0;
      for (int j = 0; j < r; ++j) {
        increment += room.slope[k * r + j] * shared.change[j];
        back += room.slope[k * r + j] * shared.way[j];
      }
      instance.reached[k] = instance.coefficient[k] + increment + back;
      instance.rate[k] = increment * inverse_dt;
      instance.ways->projection[k] = 0;
    });
    InstanceState& state = shared.state;
    each(
        r,
        [&](int j) {
          state.velocity[j] = (shared.latent[j] - state.latent[j]) * inverse_dt;
          state.latent[j] = shared.latent[j] + shared.way[j];
        },
        4 * warp_width);
    if (block.thread() != block.threads() - 1) return;
    instance.ways->moved2 = 0;
    instance.ways->furthest = instance.ways->lost = 0;
  }
};

/// The kernel.
template <typename Block>
GRAUPEL_HD void fit(const Block& block, const RunView& view, FitShared& shared, double* equation_room) {
  const InstanceView& instance = view.instances[block.index()];
  const ModelView& model = view.model;
  if (instance.state->status != RunStatus::running) return;
  const EquationCapacity room(equation_room, model);
  const Fit<Block> f{block, view, model, instance, shared, room, 1 / view.dt};
  const int lost = instance.ways->lost, warp = block.thread() / warp_width, lane = block.thread() % warp_width;
  if (lost_too_many(block, instance, model.samples)) return;
  if (lost > 0) {
    f.leave_out_lost();
    Equations<Block>{block, model, instance, room}.solve(instance.gram);
    block.sync();
  }
  f.load();
  block.sync();
  f.find_change();
  block.sync();
  if (shared.failed != 0) {
    if (block.thread() == 0) instance.state->status = RunStatus::singular;
    return;
  }
  if (view.pull > 0) f.measure_curve();
  if (warp == 1) f.measure_residual(lane);
  block.sync();
  if (view.pull > 0) f.find_way_back();
  if (block.thread() == block.threads() - 1)
    count_step(shared.state, shared.ways, static_cast<double>(instance.scene.grid.dx));
  block.sync();
  f.store();
  block.sync();
  copy_words(block, shared.state, *instance.state);
}

}  // namespace graupel::rom::device
