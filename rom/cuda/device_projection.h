// The last kernel of a step of a model of the deformation alone by modes: samples move (rom/cuda/device_gather.h), and
// the block that is the last of its instance to be done projects. The map is linear in the latent: with U the modes at
// the samples and W their weights
//   dt q' = argmin sum_s w_s |U_s dt q' - way_s|^2 = (U^T W U)^-1 U^T W way,   q <- q + dt q'.
// The positions' least squares have the same solution, so one solution serves all projections
// (rom/projection/projection.h). Where all samples have weight 1 the inverse is the model's; else U^T W U differs from
// U^T U by the samples in contact and those that are lost. All in f64.
#pragma once

#include "rom/cuda/device_equations.h"
#include "rom/cuda/device_gather.h"
#include "rom/cuda/device_state.h"

namespace graupel::rom::device {

inline constexpr int weighed_batch = 16;  ///< samples whose modes are in shared memory at once

struct ProjectionShared {
  InstanceState state;  ///< at work; written back in the end
  WaySums ways;
  double table[most_latents * (most_latents + 1)];  ///< U^T W U, and beside it U^T W way
  double rows[weighed_batch][3][most_latents];      ///< U_s
  double factor[weighed_batch];                     ///< w_s - 1
  double change[most_latents];                      ///< dt q'
  double condition;
  int failed;
};

template <typename Block>
struct Projection {
  const Block& block;
  const ModelView& model;
  const InstanceView& instance;
  ProjectionShared& shared;

  /// f(i) for i = 0 .. n - 1, by the threads of the block.
  template <typename F>
  GRAUPEL_HD void each(int n, const F& f) const {
    for (int i = block.thread(); i < n; i += block.threads()) f(i);
  }

  /// Of samples that all have weight 1; a warp a latent.
  GRAUPEL_HD void multiply_inverse() const {
    const int r = model.latents, lane = block.thread() % warp_width, warps = block.threads() / warp_width;
    for (int j = block.thread() / warp_width; j < r; j += warps) {
      double change = 0;
      for (int k = lane; k < r; k += warp_width) change += model.inverse[j * r + k] * shared.ways.projection[k];
      change = sum_of_warp(block, change);
      if (lane == 0) shared.change[j] = change;
    }
    if (block.thread() == 0) shared.condition = model.condition;
  }

  GRAUPEL_HD void solve_weighed() const {
    const int r = model.latents, width = r + 1;
    each(r * width, [&](int e) {
      const int i = e / width, j = e % width;
      shared.table[e] = j < r ? model.gram[i * r + j] : shared.ways.projection[i];
    });
    for (int first = 0; first < shared.ways.weighed; first += weighed_batch) {
      const int left = shared.ways.weighed - first, count = left < weighed_batch ? left : weighed_batch;
      add_weighed(first, count);
    }
    block.sync();
    eliminate(block, shared.table, r, width);
    each(r, [&](int j) { shared.change[j] = shared.table[j * width + r] / shared.table[j * width + j]; });
    if (block.thread() != 0) return;
    const Pivots pivots(shared.table, r, width);
    shared.condition = pivots.condition();
    if (!pivots.fine) shared.failed = 1;
  }

  /// Velocity, latent and what the next step decodes.
  GRAUPEL_HD void move(double inverse_dt) const {
    InstanceState& state = shared.state;
    each(model.latents, [&](int j) {
      state.velocity[j] = shared.change[j] * inverse_dt;
      state.latent[j] += shared.change[j];
      instance.coefficient[j] += shared.change[j];
      instance.rate[j] = state.velocity[j];
    });
  }

  /// What the step leaves beside the latent; one thread.
  GRAUPEL_HD void count() const {
    const WaySums& ways = shared.ways;
    const auto dx = static_cast<double>(instance.scene.grid.dx);
    double left2 = ways.weighted2;  // at the solution |way - U c|^2 = |way|^2 - (U^T way) . c, squares with weights
    for (int j = 0; j < model.latents; ++j) left2 -= ways.projection[j] * shared.change[j];
    take_residual(shared.state, ways, left2, ways.weight, model.samples, dx, shared.condition);
    count_step(shared.state, ways, dx);
  }

  /// For the next step.
  GRAUPEL_HD void clear_ways() const {
    WaySums& ways = *instance.ways;
    each(model.latents, [&](int k) { ways.projection[k] = 0; });
    if (block.thread() != 0) return;
    ways.moved2 = ways.weight = ways.weighted2 = 0;
    ways.furthest = ways.lost = ways.weighed = ways.arrived = 0;
  }

 private:
  /// (w_s - 1) U_s^T U_s of some of the samples that have another weight.
  GRAUPEL_HD void add_weighed(int first, int count) const {
    const int r = model.latents;
    block.sync();
    each(count * 3 * r, [&](int e) {
      const int s = e / (3 * r), k = e / 3 % r, c = e % 3;
      const int64_t row = 3 * int64_t(instance.weighed[first + s]) + c;
      shared.rows[s][c][k] = static_cast<double>(model.sample_modes[int64_t(k) * model.sample_rows + row]);
    });
    each(count,
         [&](int s) { shared.factor[s] = static_cast<double>(instance.weight[instance.weighed[first + s]]) - 1; });
    block.sync();
    each(r * r, [&](int e) {
      const int i = e / r, j = e % r;
      double sum = 0;
      for (int s = 0; s < count; ++s) {
        double product = 0;
        for (int c = 0; c < 3; ++c) product += shared.rows[s][c][i] * shared.rows[s][c][j];
        sum += shared.factor[s] * product;
      }
      shared.table[i * (r + 1) + j] += sum;
    });
  }
};

/// From the ways of all samples to the next state, by a block.
template <typename Block>
GRAUPEL_HD void project(const Block& block, const RunView& view, const InstanceView& instance,
                        ProjectionShared& shared) {
  const ModelView& model = view.model;
  if (lost_too_many(block, instance, model.samples)) return;
  const Projection<Block> projection{block, model, instance, shared};
  copy_words(block, *instance.state, shared.state);
  copy_words(block, *instance.ways, shared.ways);
  if (block.thread() == 0) shared.failed = 0;
  block.sync();
  if (shared.ways.weighed > 0)
    projection.solve_weighed();
  else
    projection.multiply_inverse();
  block.sync();
  projection.each(model.latents, [&](int j) {
    if (!(std::abs(shared.change[j]) < 1e300)) shared.failed = 1;
  });
  block.sync();
  if (shared.failed != 0) {
    if (block.thread() == 0) instance.state->status = RunStatus::singular;
    return;
  }
  projection.move(1 / view.dt);
  projection.clear_ways();
  if (block.thread() == block.threads() - 1) projection.count();
  block.sync();
  copy_words(block, shared.state, *instance.state);
}

struct GatherAndProjectShared {
  GatherShared gather;
  ProjectionShared projection;
  int is_last;
};

/// The kernel.
template <typename Block>
GRAUPEL_HD void gather_and_project(const Block& block, const RunView& view, GatherAndProjectShared& shared) {
  const InstanceView& instance = view.instances[block.index() / view.gather_blocks];
  if (instance.state->status != RunStatus::running) return;
  gather<true>(block, view, shared.gather);
  block.fence();
  block.sync();
  if (block.thread() == 0)
    shared.is_last = block.add(&instance.ways->arrived, int32_t{1}) == view.gather_blocks - 1 ? 1 : 0;
  block.sync();
  if (shared.is_last == 0) return;
  block.fence();
  project(block, view, instance, shared.projection);
}

}  // namespace graupel::rom::device
