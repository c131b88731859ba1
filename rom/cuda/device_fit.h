// The last kernel of a reduced-order model's step: Gauss-Newton for the latent (rom/gauss_newton.h), by a team of
// blocks that share the samples and the centres of the closure and write into each other's shared memory; and, where
// the samples have moved far enough, the nodes that they may read from now on.
//
// All lengths are ways of the step, not positions: residual = way - U (a(q) - a(q_0)). Single precision is then enough
// for the rows; sums over samples, the coefficients and the solution are in double precision.
//
// A Team is a Block with rank(), size(), team_sync() and at(pointer, rank): the same place in another block's shared
// memory. All blocks find the same sums in the same order, so that they take every decision alike.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

inline constexpr int fit_centers = 128;  ///< whose kernels a block keeps at once
inline constexpr int most_sums = most_deformation_modes + 3;
inline constexpr int most_pairs = most_latents * (most_latents + 1) / 2;

/// Fixed part of a block's shared memory.
struct FitShared {
  double latent[most_latents], start[most_latents], change[most_latents];
  double matrix[most_latents * most_latents], right[most_latents];
  double normal[most_sums + most_pairs];  ///< of the own samples; other blocks read it
  double total[most_sums];                ///< of all samples
  double missing[most_pairs];             ///< what samples of less weight leave out of J^T J, of all samples
  double coefficient[most_deformation_modes];
  double turned[most_deformation_modes * most_latents];  ///< U^T U da/dq
  float increment[most_deformation_modes];               ///< a(q) - a(q_0)
  double slope[most_deformation_modes * most_latents];   ///< da/dq
  double warp[fit_threads / warp_width];
  double condition, moved2;
  float median, furthest;  ///< the median is written by the block that finds it
  int lost, solved;
};

/// The arrays behind it, whose lengths follow from the model.
struct FitArrays {
  double* partial;   ///< [1 + r, closure outputs] of the own centres; other blocks read it
  double* group;     ///< [items, groups]
  double* kernel;    ///< [1 + r, fit_centers]
  float* distance2;  ///< [samples] of all blocks; below 0 for lost ones
  float* residual;   ///< [own rows]
  float* weight;     ///< [own samples]
  int* rank;         ///< [own samples] among all distances
};

GRAUPEL_HD inline int own_samples(const ModelView& model, int team) { return (model.samples + team - 1) / team; }

/// Lays the arrays out from `base` on; returns the bytes that they take.
GRAUPEL_HD inline int64_t lay_out(const ModelView& model, int team, unsigned char* base, FitArrays& to) {
  int64_t at = (sizeof(FitShared) + 15) / 16 * 16;
  const auto take = [&](auto*& array, int64_t count) {
    array = reinterpret_cast<std::remove_reference_t<decltype(array)>>(base + at);
    at += (count * static_cast<int64_t>(sizeof(*array)) + 15) / 16 * 16;
  };
  const int64_t r = model.latents, items = (1 + r) * model.closure.outputs, own = own_samples(model, team);
  take(to.partial, items);
  take(to.group, items > fit_threads ? items : fit_threads);
  take(to.kernel, (1 + r) * fit_centers);
  take(to.distance2, model.samples);
  take(to.residual, 3 * own);
  take(to.weight, own);
  take(to.rank, own);
  return at;
}

template <typename Team>
struct Fit {
  const Team& team;
  const RunView& view;
  const ModelView& model;
  const InstanceView& instance;
  FitShared& shared;
  FitArrays arrays;
  int first, count;  ///< own samples

  GRAUPEL_HD Fit(const Team& own_team, const RunView& run, const InstanceView& one, unsigned char* memory)
      : team(own_team), view(run), model(run.model), instance(one), shared(*reinterpret_cast<FitShared*>(memory)) {
    lay_out(model, team.size(), memory, arrays);
    const int share = own_samples(model, team.size());
    first = team.rank() * share;
    if (first > model.samples) first = model.samples;
    count = model.samples - first < share ? model.samples - first : share;
  }

  GRAUPEL_HD int rows() const { return 3 * count; }
  /// f(i) for i = 0 .. n - 1, by the threads of the block.
  template <typename F>
  GRAUPEL_HD void each(int n, const F& f) const {
    for (int i = team.thread(); i < n; i += team.threads()) f(i);
  }

  /// Sum over the block's threads, in a fixed order; all must call it.
  GRAUPEL_HD double block_sum(double value) const {
    value = sum_of_warp(team, value);
    if (team.thread() % warp_width == 0) shared.warp[team.thread() / warp_width] = value;
    team.sync();
    double sum = 0;
    for (int w = 0; w < team.threads() / warp_width; ++w) sum += shared.warp[w];
    team.sync();
    return sum;
  }

  // Closure: c(q) and, with `with_slope`, dc/dq.

  /// Kernels |d|^3 of the centres first .. first + n - 1 and their derivatives 3 |d| d_j, which vanish along inputs
  /// that are held.
  GRAUPEL_HD void kernels(int first_center, int n, bool with_slope) const {
    const MapView& map = model.closure;
    each(n, [&](int i) {
      double r2 = 0, d[most_latents];
      for (int j = 0; j < map.inputs; ++j) {
        d[j] = held(map, j, standardised(map, j, shared.latent[j])) -
               map.centers[int64_t(j) * map.count + first_center + i];
        r2 += d[j] * d[j];
      }
      const double distance = std::sqrt(r2);
      arrays.kernel[i] = r2 * distance;
      if (!with_slope) return;
      for (int j = 0; j < map.inputs; ++j) {
        const double y = standardised(map, j, shared.latent[j]);
        arrays.kernel[(1 + j) * fit_centers + i] = held(map, j, y) == y ? 3 * distance * d[j] : 0.0;
      }
    });
  }

  /// Sums over the own centres into arrays.partial.
  GRAUPEL_HD void closure_sums(bool with_slope) const {
    const MapView& map = model.closure;
    const int share = (map.count + team.size() - 1) / team.size(), begin = team.rank() * share;
    const int end = begin + share < map.count ? begin + share : map.count;
    const int items = (with_slope ? 1 + model.latents : 1) * map.outputs;
    const int groups = items < team.threads() ? team.threads() / items : 1;
    each(items * groups, [&](int g) { arrays.group[g] = 0; });
    for (int at = begin; at < end; at += fit_centers) {
      const int n = end - at < fit_centers ? end - at : fit_centers;
      team.sync();
      kernels(at, n, with_slope);
      team.sync();
      each(items * groups, [&](int g) {
        const int item = g % items, output = item % map.outputs;
        const double* const kernel = arrays.kernel + item / map.outputs * fit_centers;
        double sum = 0;
        for (int i = g / items; i < n; i += groups)
          sum += kernel[i] * map.weights[int64_t(at + i) * map.outputs + output];
        arrays.group[g] += sum;
      });
    }
    team.sync();
    each(items, [&](int item) {
      double sum = 0;
      for (int g = 0; g < groups; ++g) sum += arrays.group[g * items + item];
      arrays.partial[item] = sum;
    });
  }

  GRAUPEL_HD double over_team(double* own, int item) const {
    double sum = 0;
    for (int rank = 0; rank < team.size(); ++rank) sum += team.at(own, rank)[item];
    return sum;
  }

  /// a(q), its increment since the step's start, and da/dq.
  GRAUPEL_HD void evaluate(bool with_slope) const {
    const MapView& map = model.closure;
    const int r = model.latents;
    team.sync();
    if (map.outputs > 0) closure_sums(with_slope);
    team.team_sync();
    each(model.deformation_modes, [&](int k) {
      const int output = k - r;
      double a = output < 0 ? shared.latent[k] : 0.0;
      if (output >= 0) {
        const double* const linear = map.linear + int64_t(output) * (1 + r);
        a = linear[0] + over_team(arrays.partial, output);
        for (int j = 0; j < r; ++j) a += linear[1 + j] * standardised(map, j, shared.latent[j]);
      }
      shared.coefficient[k] = a;
      shared.increment[k] = static_cast<float>(a - instance.coefficient[k]);
    });
    if (with_slope)
      each(model.deformation_modes * r, [&](int i) {
        const int k = i / r, j = i % r, output = k - r;
        double slope = k == j ? 1.0 : 0.0;
        if (output >= 0)
          slope = (map.linear[int64_t(output) * (1 + r) + 1 + j] +
                   over_team(arrays.partial, (1 + j) * map.outputs + output)) *
                  map.scale[j];
        shared.slope[k * r + j] = slope;
      });
    team.sync();
  }

  // Samples.

  /// Residuals of the own rows and the distances, which all blocks get.
  GRAUPEL_HD void residuals() const {
    each(rows(), [&](int row) {
      const float* const modes = model.sample_modes + 3 * first + row;
      float residual = instance.way[3 * first + row];
      for (int k = 0; k < model.deformation_modes; ++k)
        residual -= modes[int64_t(k) * model.sample_rows] * shared.increment[k];
      arrays.residual[row] = instance.lost[first + row / 3] != 0 ? 0.0f : residual;
    });
    team.sync();
    each(count * team.size(), [&](int i) {
      const int s = i % count;
      const float* const d = arrays.residual + 3 * s;
      team.at(arrays.distance2, i / count)[first + s] =
          instance.lost[first + s] != 0 ? -1.0f : d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    });
    team.team_sync();
  }

  /// The middle one of the distances that count, by its rank: each block ranks its own samples among all.
  GRAUPEL_HD void find_median() const {
    each(count, [&](int s) { arrays.rank[s] = 0; });
    team.sync();
    const int parts = count > 0 && count < team.threads() ? team.threads() / count : 1;
    each(count * parts, [&](int i) {
      const int s = i % count, own = first + s;
      const float d = arrays.distance2[own];
      int below = 0;
      for (int other = i / count; other < model.samples; other += parts) {
        const float e = arrays.distance2[other];
        below += e >= 0.0f && (e < d || (e == d && other < own)) ? 1 : 0;
      }
      team.add(arrays.rank + s, below);
    });
    team.sync();
    const int middle = (model.samples - shared.lost) / 2;
    each(count * team.size(), [&](int i) {
      const int s = i % count;
      const float d = arrays.distance2[first + s];
      if (d >= 0.0f && arrays.rank[s] == middle) *team.at(&shared.median, i / count) = d;
    });
    team.team_sync();
  }

  /// w = min(1, limit^2 / d^2) with the limit a multiple of the median; 0 for lost samples.
  GRAUPEL_HD void weigh() const {
    const auto factor = static_cast<float>(view.fit.outlier_factor);
    if (factor > 0.0f) find_median();
    const float limit2 = factor * factor * shared.median;
    each(count, [&](int s) {
      const float d = arrays.distance2[first + s];
      arrays.weight[s] = d < 0.0f ? 0.0f : factor > 0.0f && d > limit2 ? limit2 / d : 1.0f;
    });
    team.sync();
  }

  /// U^T W residual, then sum of w d^2, of w, and the number of samples with w < 1; from value `begin` on, of all
  /// samples in shared.total.
  GRAUPEL_HD void sum_up(int begin) const {
    const int m = model.deformation_modes, n = rows(), lane = team.thread() % warp_width;
    for (int v = begin + team.thread() / warp_width; v < m + 3; v += team.threads() / warp_width) {
      float sum = 0;
      if (v < m) {
        const float* const mode = model.sample_modes + int64_t(v) * model.sample_rows + 3 * first;
        for (int row = lane; row < n; row += warp_width)
          sum += arrays.weight[row / 3] * mode[row] * arrays.residual[row];
      } else {
        for (int s = lane; s < count; s += warp_width) {
          const float w = arrays.weight[s], d = arrays.distance2[first + s];
          sum += v == m ? (d > 0.0f ? w * d : 0.0f) : v == m + 1 ? w : w < 1.0f ? 1.0f : 0.0f;
        }
      }
      const double all = sum_of_warp(team, static_cast<double>(sum));
      if (lane == 0) shared.normal[v] = all;
    }
    team.team_sync();
    each(m + 3 - begin, [&](int v) { shared.total[begin + v] = over_team(shared.normal, begin + v); });
    team.sync();
  }

  // Solution.

  /// sum over samples of (1 - w) J_i . J_j, J = U da/dq, for all pairs i <= j, into shared.missing.
  GRAUPEL_HD void sum_missing() const {
    const int r = model.latents, m = model.deformation_modes, lane = team.thread() % warp_width;
    for (int v = team.thread() / warp_width; v < r * (r + 1) / 2; v += team.threads() / warp_width) {
      int i = 0, j = v;
      while (j >= r - i) j -= r - i++;
      j += i;
      double sum = 0;
      for (int s = lane; s < count; s += warp_width) {
        const double less = 1.0 - static_cast<double>(arrays.weight[s]);
        if (less == 0.0) continue;
        for (int c = 0; c < 3; ++c) {
          const float* const row = model.sample_modes + 3 * (first + s) + c;
          double a = 0, b = 0;
          for (int k = 0; k < m; ++k) {
            const auto u = static_cast<double>(row[int64_t(k) * model.sample_rows]);
            a += u * shared.slope[k * r + i];
            b += u * shared.slope[k * r + j];
          }
          sum += less * a * b;
        }
      }
      sum = sum_of_warp(team, sum);
      if (lane == 0) shared.normal[most_sums + v] = sum;
    }
    team.team_sync();
    each(r * (r + 1) / 2, [&](int v) { shared.missing[v] = over_team(shared.normal, most_sums + v); });
    team.sync();
  }

  /// J^T W J change = J^T W residual with J = U da/dq, by L D L^T, in the first warp; adds the change. J^T W J follows
  /// from U^T U, less what samples of less weight leave out. False, in all threads, when the equations are singular or
  /// not finite.
  GRAUPEL_HD bool solve() const {
    const int r = model.latents, m = model.deformation_modes;
    const bool all_count = shared.total[m + 2] == 0.0;
    if (!all_count) sum_missing();
    each(m * r, [&](int i) {
      const int k = i / r, j = i % r;
      double sum = 0;
      for (int l = 0; l < m; ++l) sum += model.gram[int64_t(k) * m + l] * shared.slope[l * r + j];
      shared.turned[k * r + j] = sum;
    });
    team.sync();
    each(r * (r + 1), [&](int e) {
      const int i = e / (r + 1), j = e % (r + 1);
      double sum = 0;
      for (int k = 0; k < m; ++k)
        sum += shared.slope[k * r + i] * (j == r ? shared.total[k] : shared.turned[k * r + j]);
      if (j == r) {
        shared.right[i] = sum;
        return;
      }
      const int low = i < j ? i : j, high = i < j ? j : i;
      if (!all_count) sum -= shared.missing[low * r - low * (low - 1) / 2 + high - low];
      shared.matrix[i * r + j] = sum;
    });
    team.sync();
    if (team.thread() < warp_width) {
      const int lane = team.thread();
      double trace = 0;
      for (int i = 0; i < r; ++i) trace += shared.matrix[i * r + i];
      constexpr double ridge = 1e-12;  // of the mean diagonal
      team.sync_warp();
      if (lane < r) shared.matrix[lane * r + lane] += ridge * trace / r;
      team.sync_warp();
      eliminate(lane);
      substitute(lane);
      if (lane == 0) take_change();
    }
    team.sync();
    return shared.solved != 0;
  }

  /// Leaves L D below the diagonal, D on it, and L^-1 right.
  GRAUPEL_HD void eliminate(int lane) const {
    const int r = model.latents;
    double* const A = shared.matrix;
    for (int j = 0; j + 1 < r; ++j) {
      const double inverse = 1 / A[j * r + j];
      const int n = r - j - 1;
      for (int e = lane; e < n * n; e += warp_width) {
        const int i = j + 1 + e / n, k = j + 1 + e % n;
        if (k <= i) A[i * r + k] -= A[i * r + j] * inverse * A[k * r + j];
      }
      for (int i = j + 1 + lane; i < r; i += warp_width) shared.right[i] -= A[i * r + j] * inverse * shared.right[j];
      team.sync_warp();
    }
  }
  GRAUPEL_HD void substitute(int lane) const {
    const int r = model.latents;
    const double* const A = shared.matrix;
    for (int j = r - 1; j >= 0; --j) {
      const double x = shared.right[j] / A[j * r + j];
      for (int k = lane; k < j; k += warp_width) shared.right[k] -= A[j * r + k] * x;
      if (lane == 0) shared.change[j] = x;
      team.sync_warp();
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
    if (fine)
      for (int j = 0; j < r; ++j) shared.latent[j] += shared.change[j];
  }
  GRAUPEL_HD bool converged() const {
    double change2 = 0, size2 = 0;
    for (int j = 0; j < model.latents; ++j) {
      change2 += shared.change[j] * shared.change[j];
      size2 += shared.latent[j] * shared.latent[j];
    }
    return std::sqrt(change2) <= view.fit.tolerance * (1 + std::sqrt(size2));
  }

  /// Improves shared.latent; the number of iterations, or -1 where it failed.
  GRAUPEL_HD int improve() const {
    evaluate(true);
    residuals();
    int iterations = 0;
    while (iterations < view.fit.iterations) {
      weigh();
      sum_up(0);
      if (!solve()) return -1;
      ++iterations;
      const bool with_slope = view.fit.linearise_always;
      evaluate(with_slope);
      residuals();
      if (converged()) break;
    }
    weigh();
    sum_up(model.deformation_modes);
    return iterations;
  }

  /// Way of the samples: how many are lost, the sum of the squares and the largest.
  GRAUPEL_HD void survey_ways() const {
    double lost = 0, moved2 = 0;
    float furthest2 = 0;
    each(model.samples, [&](int s) {
      lost += instance.lost[s] != 0 ? 1 : 0;
      float way2 = 0;
      for (int d = 0; d < 3; ++d) way2 += instance.way[3 * s + d] * instance.way[3 * s + d];
      moved2 += static_cast<double>(way2);
      furthest2 = way2 > furthest2 ? way2 : furthest2;
    });
    if (team.thread() == 0) shared.furthest = 0;
    lost = block_sum(lost);
    moved2 = block_sum(moved2);
    for (int mask = warp_width / 2; mask > 0; mask /= 2) {
      const float other = team.shuffle_xor(furthest2, mask);
      furthest2 = other > furthest2 ? other : furthest2;
    }
    if (team.thread() % warp_width == 0) shared.warp[team.thread() / warp_width] = static_cast<double>(furthest2);
    team.sync();
    if (team.thread() == 0) {
      for (int w = 0; w < team.threads() / warp_width; ++w)
        if (shared.warp[w] > static_cast<double>(shared.furthest)) shared.furthest = static_cast<float>(shared.warp[w]);
      shared.furthest = std::sqrt(shared.furthest);
      shared.lost = static_cast<int>(lost);
      shared.moved2 = moved2;
      shared.median = 0;
    }
    team.sync();
  }

  /// Writes the new state, and whether the integration points must be found again, for the team.
  GRAUPEL_HD void store(int iterations, double moved) const {
    InstanceState& state = *instance.state;
    const int r = model.latents;
    each(model.deformation_modes, [&](int k) {
      instance.rate[k] = (shared.coefficient[k] - instance.coefficient[k]) / view.dt;
      instance.coefficient[k] = shared.coefficient[k];
    });
    each(r, [&](int j) {
      state.velocity[j] = (shared.latent[j] - shared.start[j]) / view.dt;
      state.latent[j] = shared.latent[j];
    });
    if (team.thread() != 0) return;
    const double* const sums = shared.total + model.deformation_modes;  // of w d^2, of w, number of w < 1
    const double distance = sums[1] > 0 ? std::sqrt(sums[0] / sums[1]) : 0.0;
    const double way = std::sqrt(shared.moved2 / model.samples), least = 1e-4 * static_cast<double>(dx());
    const double residual = distance / (way > least ? way : least);
    state.residual = residual > state.residual ? residual : state.residual;
    state.down_weighted += sums[2] / model.samples;
    state.condition = shared.condition > state.condition ? shared.condition : state.condition;
    state.iterations += iterations;
    state.points_sum += state.point_count;
    state.most_points = state.point_count > state.most_points ? state.point_count : state.most_points;
    state.moved = moved;
    ++state.steps;
    ++state.step;
  }
  GRAUPEL_HD float dx() const { return instance.scene.grid.dx; }

  // Nodes.

  /// Marks the nodes that samples at shared.coefficient can read until they have moved by half a cell: their stencils
  /// and one node more on every side. `old_count` nodes are marked so far.
  GRAUPEL_HD void mark_nodes(int32_t old_count) const {
    const int threads = team.size() * team.threads(), own = team.rank() * team.threads() + team.thread();
    for (int32_t i = own; i < old_count; i += threads) instance.node_place[instance.node_list[i]] = 0;
    if (own == 0) {
      instance.state->node_count = instance.state->point_count = 0;
      instance.state->moved = 0;
    }
    each(rows(), [&](int row) {
      const float* const modes = model.sample_modes + 3 * first + row;
      double x = model.sample_mean[3 * first + row];
      for (int k = 0; k < model.deformation_modes; ++k)
        x += static_cast<double>(modes[int64_t(k) * model.sample_rows]) * shared.coefficient[k];
      arrays.residual[row] = static_cast<float>(x);
    });
    team.fence();
    team.team_sync();
    constexpr int width = 5;
    each(count * width * width * width, [&](int i) {
      const int s = i / (width * width * width), n = i % (width * width * width);
      const float* const x = arrays.residual + 3 * s;
      const Stencil stencil = stencil_at(instance, {x[0], x[1], x[2]});
      if (!stencil.inside) return;
      const Vec<int, 3> at = stencil.base + Vec<int, 3>{n / (width * width) - 1, n / width % width - 1, n % width - 1};
      for (int d = 0; d < 3; ++d)
        if (at[d] < 0 || at[d] >= instance.nodes[d]) return;
      const auto node = static_cast<int32_t>(node_number(instance.nodes, at));
      int32_t* const place = instance.node_place + node;
      if (*place != 0 || team.max(place, int32_t{1}) != 0) return;
      const int32_t number = team.add(&instance.state->node_count, int32_t{1});
      instance.node_list[number] = node;
      team.exchange(place, number + first_place);
    });
  }
};

/// The kernel: `memory` is as lay_out() wants it.
template <typename Team>
GRAUPEL_HD void fit(const Team& team, const RunView& view, unsigned char* memory) {
  const InstanceView& instance = view.instances[team.index() / team.size()];
  InstanceState& state = *instance.state;
  const bool running = state.status == RunStatus::running;
  const int32_t nodes = state.node_count;
  const double moved_before = state.moved;
  if (!running) return;  // the whole team
  const Fit<Team> f(team, view, instance, memory);
  f.each(view.model.latents, [&](int j) {
    f.shared.start[j] = state.latent[j];
    f.shared.latent[j] = state.latent[j] + view.dt * state.velocity[j];
  });
  f.survey_ways();
  const bool leader = team.rank() == 0;
  if (2 * f.shared.lost > view.model.samples) {
    team.team_sync();  // all have read the state
    if (leader && team.thread() == 0) state.status = RunStatus::samples_lost;
    return;
  }
  const int iterations = f.improve();
  team.team_sync();
  if (iterations < 0) {
    if (leader && team.thread() == 0) state.status = RunStatus::singular;
    return;
  }
  const double moved = moved_before + static_cast<double>(f.shared.furthest);
  const bool due = 2 * moved > static_cast<double>(f.dx());  // a sample and a point may move towards each other
  if (leader) {
    f.store(iterations, moved);
    if (team.thread() == 0) state.due = due ? 1 : 0;
    team.sync();
  }
  if (due) f.mark_nodes(nodes);
  team.team_sync();  // no block ends while another reads its memory
}

/// Before the first step: marks the nodes of the initial state.
template <typename Team>
GRAUPEL_HD void mark(const Team& team, const RunView& view, unsigned char* memory) {
  const InstanceView& instance = view.instances[team.index() / team.size()];
  const int32_t nodes = instance.state->node_count;
  const Fit<Team> f(team, view, instance, memory);
  f.each(view.model.deformation_modes, [&](int k) { f.shared.coefficient[k] = instance.coefficient[k]; });
  team.team_sync();
  f.mark_nodes(nodes);
  if (team.rank() == 0 && team.thread() == 0) instance.state->due = 1;
  team.team_sync();
}

}  // namespace graupel::rom::device
