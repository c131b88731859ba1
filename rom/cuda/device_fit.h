// The last kernel of a reduced-order model's step: the latent that fits the samples' ways best, by one step of
// Gauss-Newton from q* = q + dt q' in f64, a block an instance. With U the modes at the samples, G = U^T U, a(q) the
// deformation's coefficients, S = da/dq at q*, and a_0 those before the step,
//   S^T G S dq = S^T (U^T way - G (a(q*) - a_0)),   q <- q* + dq:
// the samples themselves are not needed any more. Lengths are ways, not positions, so that nothing is lost to rounding.
// A part of the way back to the training's curve follows, without a change of velocity.
#pragma once

#include "rom/cuda/device_step.h"
#include "rom/latent_state.h"

namespace graupel::rom::device {

/// G has room in shared memory up to so many modes.
inline constexpr int small_gram = 32;

inline constexpr int curve_parts = 2 * curve_window + 1;

struct FitShared {
  InstanceState state;  ///< at work; written back in the end
  WaySums ways;
  double ahead[most_deformation_modes], before[most_deformation_modes];  ///< a(q*), a_0
  double slope[most_deformation_modes * most_latents];                   ///< S
  double gram[small_gram * small_gram];
  double change[most_latents], right[most_latents], inverse[most_latents];
  double matrix[most_latents * most_latents];
  double projected[most_deformation_modes];              ///< U^T way - G (a(q*) - a_0)
  double turned[most_deformation_modes * most_latents];  ///< G S
  double increment[most_deformation_modes];              ///< of the coefficients over the step
  double warp[step_warps];
  double condition;
  double curve[(curve_parts + 1) * most_latents];               ///< around the present
  double way[most_latents];                                     ///< of the way back that the step takes
  double part_distance2[curve_parts], part_share[curve_parts];  ///< of parts of the curve
  int solved;
};

template <typename Block>
struct Fit {
  const Block& block;
  const RunView& view;
  const ModelView& model;
  const InstanceView& instance;
  FitShared& shared;
  const double* gram;  ///< G of the samples that count

  /// f(i) for i = 0 .. n - 1, by the threads of the block.
  template <typename F>
  GRAUPEL_HD void each(int n, const F& f) const {
    for (int i = block.thread(); i < n; i += block.threads()) f(i);
  }

  /// Sum over the block's threads, in a fixed order; all must call it.
  GRAUPEL_HD double block_sum(double value) const {
    value = sum_of_warp(block, value);
    if (block.thread() % warp_width == 0) shared.warp[block.thread() / warp_width] = value;
    block.sync();
    double sum = 0;
    for (int w = 0; w < block.threads() / warp_width; ++w) sum += shared.warp[w];
    block.sync();
    return sum;
  }

  /// A struct by words of eight bytes.
  template <typename T>
  GRAUPEL_HD void copy(const T& from, T& to) const {
    static_assert(sizeof(T) % 8 == 0 && alignof(T) == 8);
    each(static_cast<int>(sizeof(T) / 8), [&](int i) {
      __builtin_memcpy(reinterpret_cast<char*>(&to) + 8 * i, reinterpret_cast<const char*>(&from) + 8 * i, 8);
    });
  }

  /// All that the step needs, into shared memory at once.
  GRAUPEL_HD void load() {
    const int m = model.deformation_modes;
    copy(*instance.state, shared.state);
    copy(*instance.ways, shared.ways);
    each(m, [&](int k) {
      shared.ahead[k] = instance.ahead[k];
      shared.before[k] = instance.coefficient[k];
    });
    each(m * model.latents, [&](int i) { shared.slope[i] = instance.slope[i]; });
    if (m <= small_gram) {
      each(m * m, [&](int i) { shared.gram[i] = model.gram[i]; });
      gram = shared.gram;
    }
    block.sync();
  }

  /// G without the samples that are lost.
  GRAUPEL_HD void leave_out_lost() {
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
    gram = instance.gram;
    block.sync();
  }

  /// The normal equations' two sides.
  GRAUPEL_HD void assemble() const {
    const int r = model.latents, m = model.deformation_modes;
    const double* const slope = shared.slope;
    each(m * (1 + r), [&](int i) {
      const int k = i % m, j = i / m - 1;
      double sum = 0;
      for (int l = 0; l < m; ++l)
        sum += gram[int64_t(l) * m + k] * (j < 0 ? shared.ahead[l] - shared.before[l] : slope[l * r + j]);
      if (j < 0)
        shared.projected[k] = shared.ways.projection[k] - sum;
      else
        shared.turned[k * r + j] = sum;
    });
    block.sync();
    each(r * (r + 1), [&](int e) {
      const int i = e / (r + 1), j = e % (r + 1);
      double sum = 0;
      for (int k = 0; k < m; ++k) sum += slope[k * r + i] * (j == r ? shared.projected[k] : shared.turned[k * r + j]);
      (j == r ? shared.right[i] : shared.matrix[i * r + j]) = sum;
    });
    block.sync();
  }

  /// The change from q*, by L D L^T in the first warp. False, in all threads, when the equations are singular or not
  /// finite.
  GRAUPEL_HD bool solve() const {
    const int r = model.latents;
    if (block.thread() < warp_width) {
      const int lane = block.thread();
      double trace = 0;
      for (int i = 0; i < r; ++i) trace += shared.matrix[i * r + i];
      constexpr double ridge = 1e-12;  // of the mean diagonal
      block.sync_warp();
      if (lane < r) shared.matrix[lane * r + lane] += ridge * trace / r;
      block.sync_warp();
      eliminate(lane);
      substitute(lane);
      if (lane == 0) take_change();
    }
    block.sync();
    return shared.solved != 0;
  }

  /// Leaves L D below the diagonal, D on it and its inverse beside, and L^-1 right.
  GRAUPEL_HD void eliminate(int lane) const {
    const int r = model.latents;
    double* const A = shared.matrix;
    for (int j = 0; j < r; ++j) {
      const double inverse = 1 / A[j * r + j];
      if (lane == 0) shared.inverse[j] = inverse;
      const int n = r - j - 1;
      for (int e = lane; e < n * n; e += warp_width) {
        const int i = j + 1 + e / n, k = j + 1 + e % n;
        if (k <= i) A[i * r + k] -= A[i * r + j] * inverse * A[k * r + j];
      }
      for (int i = j + 1 + lane; i < r; i += warp_width) shared.right[i] -= A[i * r + j] * inverse * shared.right[j];
      block.sync_warp();
    }
  }
  GRAUPEL_HD void substitute(int lane) const {
    const int r = model.latents;
    const double* const A = shared.matrix;
    for (int j = r - 1; j >= 0; --j) {
      const double x = shared.right[j] * shared.inverse[j];
      for (int k = lane; k < j; k += warp_width) shared.right[k] -= A[j * r + k] * x;
      if (lane == 0) shared.change[j] = x;
      block.sync_warp();
    }
  }
  GRAUPEL_HD void take_change() const {
    const int r = model.latents;
    double low = shared.matrix[0], high = low;
    bool fine = true;
    for (int j = 0; j < r; ++j) {
      const double pivot = shared.matrix[j * r + j];
      fine = fine && pivot > 0 && pivot < 1e300 && std::abs(shared.change[j]) < 1e300;
      low = pivot < low ? pivot : low;
      high = pivot > high ? pivot : high;
    }
    shared.condition = high / low;
    shared.solved = fine ? 1 : 0;
  }

  /// The way back to the curve of the training (rom/latent_manifold.h), as far as the step takes it; a part of the
  /// curve a thread.
  GRAUPEL_HD void find_way_back() const {
    const int r = model.latents;
    const InstanceState& state = shared.state;
    const auto latent = [&](int j) { return state.latent[j] + view.dt * state.velocity[j] + shared.change[j]; };
    const auto now = static_cast<int32_t>(static_cast<double>(state.steps + 1) * view.curve_step);
    const int first = now > curve_window ? now - curve_window : 0, last = instance.curve_points - 2;
    const int there = (instance.curve_points - first) * r;  // numbers of the curve from the first part on
    each((curve_parts + 1) * r, [&](int i) {
      if (i < there) shared.curve[i] = instance.curve[int64_t(first) * r + i];
    });
    block.sync();
    each(curve_parts, [&](int part) {
      shared.part_distance2[part] = 1e300;
      if (first + part > (now + curve_window < last ? now + curve_window : last)) return;
      const double* const from = shared.curve + part * r;
      double along = 0, length2 = 0, distance2 = 0;
      for (int j = 0; j < r; ++j) {
        along += (from[r + j] - from[j]) * (latent(j) - from[j]);
        length2 += (from[r + j] - from[j]) * (from[r + j] - from[j]);
      }
      double share = along / (length2 > 1e-300 ? length2 : 1e-300);
      share = share < 0 ? 0.0 : share > 1 ? 1.0 : share;
      for (int j = 0; j < r; ++j) {
        const double d = latent(j) - from[j] - share * (from[r + j] - from[j]);
        distance2 += d * d;
      }
      shared.part_distance2[part] = distance2;
      shared.part_share[part] = share;
    });
    block.sync();
    each(r, [&](int j) {
      int nearest = 0;
      for (int part = 1; part < curve_parts; ++part)
        if (shared.part_distance2[part] < shared.part_distance2[nearest]) nearest = part;
      if (!(shared.part_distance2[nearest] < 1e300)) return;  // the run is longer than the training's
      const double* const from = shared.curve + nearest * r;
      const double point = from[j] + shared.part_share[nearest] * (from[r + j] - from[j]);
      shared.way[j] = view.pull * (point - latent(j));
    });
  }

  /// Square of the distance that is left: way^2 - 2 b . da + da^T G da with b = U^T way and da the coefficients'
  /// change, to first order in the latent's.
  GRAUPEL_HD double distance2() const {
    const int r = model.latents, m = model.deformation_modes;
    each(m, [&](int k) {
      double a = shared.ahead[k], back = 0;
      for (int j = 0; j < r; ++j) {
        a += shared.slope[k * r + j] * shared.change[j];
        back += shared.slope[k * r + j] * shared.way[j];
      }
      shared.increment[k] = a - shared.before[k];
      instance.reached[k] = a + back;
      instance.rate[k] = shared.increment[k] / view.dt;
    });
    block.sync();
    double sum = 0;
    each(m, [&](int k) {
      double turned = -2 * shared.ways.projection[k];
      for (int l = 0; l < m; ++l) turned += gram[int64_t(l) * m + k] * shared.increment[l];
      sum += turned * shared.increment[k];
    });
    sum = block_sum(sum) + shared.ways.moved2;
    return sum > 0 ? sum : 0.0;
  }

  /// The new state; one thread.
  GRAUPEL_HD void store(double left2) const {
    InstanceState& state = shared.state;
    const WaySums& ways = shared.ways;
    for (int j = 0; j < model.latents; ++j) {
      const double latent = state.latent[j] + view.dt * state.velocity[j] + shared.change[j];
      state.velocity[j] = (latent - state.latent[j]) / view.dt;
      state.latent[j] = latent + shared.way[j];
    }
    const double dx = instance.scene.grid.dx, least = 1e-4 * dx, counted = model.samples - ways.lost;
    const double way2 = ways.moved2 / model.samples;
    const double residual = std::sqrt(left2 / (counted * (way2 > least * least ? way2 : least * least)));
    state.residual = residual > state.residual ? residual : state.residual;
    state.down_weighted += static_cast<double>(ways.lost) / model.samples;
    state.condition = shared.condition > state.condition ? shared.condition : state.condition;
    state.points_sum += state.point_count;
    state.most_points = state.point_count > state.most_points ? state.point_count : state.most_points;
    ++state.steps;
    ++state.step;
    float furthest2;
    __builtin_memcpy(&furthest2, &ways.furthest, sizeof furthest2);
    state.moved += static_cast<double>(std::sqrt(furthest2));
    state.due = 2 * state.moved > dx ? 1 : 0;  // a sample and a point may move towards each other
    if (state.due == 0) return;
    ++state.round;
    state.moved = 0;
    state.node_count = state.point_count = 0;
  }
};

/// The kernel.
template <typename Block>
GRAUPEL_HD void fit(const Block& block, const RunView& view, FitShared& shared) {
  const InstanceView& instance = view.instances[block.index()];
  const ModelView& model = view.model;
  Fit<Block> f{block, view, model, instance, shared, model.gram};
  f.load();
  if (shared.state.status != RunStatus::running) return;
  RunStatus status = RunStatus::running;
  if (2 * shared.ways.lost > model.samples) {
    status = RunStatus::samples_lost;
  } else {
    if (shared.ways.lost > 0) f.leave_out_lost();
    f.assemble();
    if (!f.solve()) status = RunStatus::singular;
  }
  if (status != RunStatus::running) {
    if (block.thread() == 0) instance.state->status = status;
    return;
  }
  f.each(model.latents, [&](int j) { shared.way[j] = 0; });
  block.sync();
  if (view.pull > 0) f.find_way_back();
  block.sync();
  const double left2 = f.distance2();
  if (block.thread() == 0) f.store(left2);
  block.sync();
  f.copy(shared.state, *instance.state);
  f.each(model.deformation_modes, [&](int k) { instance.ways->projection[k] = 0; });
  if (block.thread() != 0) return;
  instance.ways->moved2 = 0;
  instance.ways->furthest = instance.ways->lost = 0;
}

}  // namespace graupel::rom::device
