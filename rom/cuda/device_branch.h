// The first kernel of a reduced-order model's step. A block evaluates an output of a coefficient map: of stress and
// affine velocity at (q, mu), of the deformation's closure at q, at q - dt q', where the step before began, and, with
// its slope, at q* = q + dt q', where the fit starts. Other blocks clear the sums of nodes or, where that is due, mark
// the blocks of nodes that samples can read.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

inline constexpr int most_inputs = 2 * most_closure_latents;  ///< latents and parameters
struct BranchShared {
  double place[most_inputs], inside[most_inputs];  ///< standardised input, and the same clamped to the centres' box
  double sums[step_warps][1 + most_closure_latents];
  int32_t first_place[step_warps];  ///< of the nodes that a warp marks at once
};

/// c_k(z) and, for `slope`, dc_k/dz_j, by a block, in its first thread. `input(j)` is z_j.
template <bool slope, typename Block, typename Input>
GRAUPEL_HD void map_output(const Block& block, const MapView& map, const Input& input, int output, BranchShared& shared,
                           double* to) {
  constexpr int most = slope ? most_closure_latents : 0;
  const int lane = block.thread() % warp_width, warp = block.thread() / warp_width;
  for (int j = block.thread(); j < map.inputs; j += block.threads()) {
    shared.place[j] = standardised(map, j, input(j));
    shared.inside[j] = clamped(map, j, shared.place[j]);
  }
  block.sync();
  constexpr int batch = 4;  // centres of a thread at once: they are waited for together
  double radial[1 + most] = {};
  const double* const weights = map.weights + int64_t(output) * map.count;
  for (int first = block.thread(); first < map.count; first += batch * block.threads()) {
    const double* center[batch];
    double r2[batch] = {}, w[batch];
    GRAUPEL_UNROLL
    for (int b = 0; b < batch; ++b) {
      const int i = first + b * block.threads();
      center[b] = map.centers + (i < map.count ? i : first);
      w[b] = i < map.count ? weights[i] : 0.0;
    }
    for (int j = 0; j < map.inputs; ++j) {
      GRAUPEL_UNROLL
      for (int b = 0; b < batch; ++b) {
        const double d = shared.inside[j] - center[b][int64_t(j) * map.count];
        r2[b] += d * d;
      }
    }
    GRAUPEL_UNROLL
    for (int b = 0; b < batch; ++b) {
      const double r = std::sqrt(r2[b]);
      radial[0] += w[b] * r2[b] * r;
      w[b] *= 3 * r;
    }
    GRAUPEL_UNROLL
    for (int j = 0; j < most; ++j) {
      if (j >= map.inputs) continue;
      GRAUPEL_UNROLL
      for (int b = 0; b < batch; ++b) radial[1 + j] += w[b] * (shared.inside[j] - center[b][int64_t(j) * map.count]);
    }
  }
  GRAUPEL_UNROLL
  for (int j = 0; j <= most; ++j) {
    if (j > map.inputs) continue;
    radial[j] = sum_of_warp(block, radial[j]);
    if (lane == 0) shared.sums[warp][j] = radial[j];
  }
  block.sync();
  if (block.thread() != 0) return;
  const double* const linear = map.linear + int64_t(output) * (1 + map.inputs);
  to[0] = linear[0];
  for (int w = 0; w < step_warps; ++w) to[0] += shared.sums[w][0];
  for (int j = 0; j < map.inputs; ++j) {
    to[0] += linear[1 + j] * shared.place[j];
    if constexpr (slope) {
      double steep = linear[1 + j];
      // The radial part is constant where an input is clamped.
      for (int w = 0; w < step_warps && shared.inside[j] == shared.place[j]; ++w) steep += shared.sums[w][1 + j];
      to[1 + j] = steep * map.scale[j];
    }
  }
}

/// Blocks of each part, a block an output.
struct BranchBlocks {
  int stress, affine, current, earlier, ahead;
  GRAUPEL_HD explicit BranchBlocks(const ModelView& model)
      : stress(model.stress_map.outputs),
        affine(model.affine_map.outputs),
        current(model.deformation_modes),
        earlier(model.deformation_modes),
        ahead(model.deformation_modes) {}
  GRAUPEL_HD int all() const { return stress + affine + current + earlier + ahead; }
};

/// Coefficient of a mode of the deformation at the latent `input`; before the first step those of the start stay.
template <typename Block, typename Input>
GRAUPEL_HD void deformation_at(const Block& block, const RunView& view, const InstanceView& instance,
                               const Input& input, int mode, BranchShared& shared, double* to) {
  if (instance.state->steps == 0) return;
  double a[1];
  if (mode < view.model.latents)
    a[0] = input(mode);
  else
    map_output<false>(block, view.model.closure, input, mode - view.model.latents, shared, a);
  if (block.thread() == 0) to[mode] = a[0];
}

/// Coefficients and slopes da/dq where the velocity takes the latent.
template <typename Block>
GRAUPEL_HD void deformation_ahead(const Block& block, const RunView& view, const InstanceView& instance, int mode,
                                  BranchShared& shared) {
  const InstanceState& state = *instance.state;
  const int r = view.model.latents;
  const auto input = [&](int j) { return state.latent[j] + view.dt * state.velocity[j]; };
  double a[1 + most_closure_latents];
  if (mode < r) {
    a[0] = input(mode);
    for (int j = 0; j < r; ++j) a[1 + j] = j == mode ? 1.0 : 0.0;
  } else {
    map_output<true>(block, view.model.closure, input, mode - r, shared, a);
  }
  if (block.thread() != 0) return;
  instance.ahead[mode] = a[0];
  for (int j = 0; j < r; ++j) instance.slope[mode * r + j] = a[1 + j];
}

/// Marks a block of nodes a lane, each once, and clears their sums; `number` -1: none. All lanes of the warp must call
/// it.
template <typename Block>
GRAUPEL_HD void mark_warp(const Block& block, const InstanceView& instance, int32_t number, int32_t round,
                          BranchShared& shared) {
  using Mark = long long;
  const auto round_of = [](Mark value) { return static_cast<int32_t>(value >> 32); };
  Mark* const mark = instance.block_mark + (number < 0 ? 0 : number);
  const bool mine = number >= 0 && round_of(*mark) != round && round_of(block.max(mark, Mark{round} << 32)) != round;
  // One count for all lanes: adding one by one, thousands of threads would wait for each other.
  const uint32_t all = block.ballot(mine);
  if (all == 0) return;
  const int lane = block.thread() % warp_width, warp = block.thread() / warp_width;
  if (lane == 0) shared.first_place[warp] = block.add(&instance.state->block_count, ones_of(all));
  block.sync_warp();
  const int32_t first = shared.first_place[warp];
  block.sync_warp();
  if (mine) *mark = Mark{round} << 32 | (first + ones_of(all & ((uint32_t{1} << lane) - 1)));
  constexpr int sums_of_block = block_nodes * mpm::channels;
  float* const sums = instance.sums + int64_t(first) * sums_of_block;
  for (int i = lane; i < ones_of(all) * sums_of_block; i += warp_width) sums[i] = 0.0f;
}

/// Marks the blocks of nodes that samples can read until they have moved by half a cell: those of their stencils and of
/// one node more on every side; a warp a sample.
template <typename Block>
GRAUPEL_HD void mark_blocks(const Block& block, const RunView& view, const InstanceView& instance, int first_warp,
                            int warps, BranchShared& shared) {
  constexpr int margin = 1, last = 2 + margin;  // from the stencil's first node; such a box meets two blocks an axis
  const int lane = block.thread() % warp_width;
  const MarkedGrid grid(instance);
  for (int s = first_warp; s < view.model.samples; s += warps) {
    const Vec<double, 3> x = sample_position(block, view.model, instance.reached, s);
    const GridStencil stencil = grid.stencil_at(x.template cast<float>());
    if (!stencil.inside) continue;
    Vec<int, 3> corner = stencil.base;
    for (int d = 0; d < 3; ++d) {
      corner[d] += (lane >> d & 1) != 0 ? last : -margin;
      corner[d] = corner[d] < 0 ? 0 : corner[d] >= grid.nodes(d) ? grid.nodes(d) - 1 : corner[d];
    }
    mark_warp(block, instance, lane < 8 ? grid.block_index(corner) : -1, grid.round, shared);
  }
}

/// Clears the sums of all marked blocks, or marks others.
template <typename Block>
GRAUPEL_HD void prepare_nodes(const Block& block, const RunView& view, const InstanceView& instance, int worker,
                              BranchShared& shared) {
  if (instance.state->due != 0) {
    mark_blocks(block, view, instance, worker * step_warps + block.thread() / warp_width,
                view.worker_blocks * step_warps, shared);
    return;
  }
  const int64_t sums = int64_t(instance.state->block_count) * block_nodes * mpm::channels;
  for (int64_t i = int64_t(worker) * block.threads() + block.thread(); i < sums;
       i += view.worker_blocks * block.threads())
    instance.sums[i] = 0.0f;
}

template <typename Block>
GRAUPEL_HD void branch(const Block& block, const RunView& view, BranchShared& shared) {
  const ModelView& model = view.model;
  const BranchBlocks blocks(model);
  const int per_instance = blocks.all() + view.worker_blocks;
  const InstanceView& instance = view.instances[block.index() / per_instance];
  if (instance.state->status != RunStatus::running) return;
  int part = block.index() % per_instance;
  if (part < blocks.ahead) return deformation_ahead(block, view, instance, part, shared);
  part -= blocks.ahead;
  const InstanceState& state = *instance.state;
  if (part < blocks.current) {
    const auto current = [&](int j) { return state.latent[j]; };
    return deformation_at(block, view, instance, current, part, shared, instance.coefficient);
  }
  part -= blocks.current;
  if (part < blocks.earlier) {
    const auto earlier = [&](int j) { return state.latent[j] - view.dt * state.velocity[j]; };
    return deformation_at(block, view, instance, earlier, part, shared, instance.earlier);
  }
  part -= blocks.earlier;
  if (part >= blocks.stress + blocks.affine)
    return prepare_nodes(block, view, instance, part - blocks.stress - blocks.affine, shared);
  const bool stress = part < blocks.stress;
  const auto input = [&](int j) {
    return j < model.latents ? state.latent[j] : instance.parameters[j - model.latents];
  };
  double value[1];
  map_output<false>(block, stress ? model.stress_map : model.affine_map, input, stress ? part : part - blocks.stress,
                    shared, value);
  if (block.thread() == 0) instance.map_rows[part] = value[0];
}

}  // namespace graupel::rom::device
