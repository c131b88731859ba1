// The first kernel of a reduced-order model's step. A block evaluates an output of a coefficient map: of stress and
// affine velocity at (q, mu), of the deformation's closure at q and, with its slope, at q* = q + dt q', where the fit
// starts. Other blocks clear the sums of nodes or, where that is due, mark the nodes that samples can read.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

inline constexpr int most_inputs = 2 * most_latents;  ///< latents and parameters
struct BranchShared {
  double place[most_inputs], inside[most_inputs];  ///< standardised input, and the same held at the centres' box
  double sums[step_warps][1 + most_latents];
  int32_t first_place[step_warps];  ///< of the nodes that a warp marks at once
};

/// c_k(z) and, for `slope`, dc_k/dz_j, by a block, in its first thread. `input(j)` is z_j.
template <bool slope, typename Block, typename Input>
GRAUPEL_HD void map_output(const Block& block, const MapView& map, const Input& input, int output, BranchShared& shared,
                           double* to) {
  constexpr int most = slope ? most_latents : 0;
  const int lane = block.thread() % warp_width, warp = block.thread() / warp_width;
  for (int j = block.thread(); j < map.inputs; j += block.threads()) {
    shared.place[j] = standardised(map, j, input(j));
    shared.inside[j] = held(map, j, shared.place[j]);
  }
  block.sync();
  double radial[1 + most] = {};
  const double* const weights = map.weights + int64_t(output) * map.count;
  for (int i = block.thread(); i < map.count; i += block.threads()) {
    double r2 = 0;
    for (int j = 0; j < map.inputs; ++j) {
      const double d = shared.inside[j] - map.centers[int64_t(j) * map.count + i];
      r2 += d * d;
    }
    const double r = std::sqrt(r2), w = weights[i];
    radial[0] += w * r2 * r;
    GRAUPEL_UNROLL
    for (int j = 0; j < most; ++j)
      if (j < map.inputs) radial[1 + j] += 3 * w * r * (shared.inside[j] - map.centers[int64_t(j) * map.count + i]);
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
      // The radial part is constant where an input is held.
      for (int w = 0; w < step_warps && shared.inside[j] == shared.place[j]; ++w) steep += shared.sums[w][1 + j];
      to[1 + j] = steep * map.scale[j];
    }
  }
}

/// Blocks of each part, a block an output.
struct BranchBlocks {
  int stress, affine, now, ahead;
  GRAUPEL_HD explicit BranchBlocks(const ModelView& model)
      : stress(model.stress_map.outputs),
        affine(model.affine_map.outputs),
        now(model.deformation_modes),
        ahead(model.deformation_modes) {}
  GRAUPEL_HD int all() const { return stress + affine + now + ahead; }
};

/// Coefficients of the deformation at q, and their change from q - dt q' over dt; before the first step both are those
/// of the start.
template <typename Block>
GRAUPEL_HD void deformation_now(const Block& block, const RunView& view, const InstanceView& instance, int mode,
                                BranchShared& shared) {
  const InstanceState& state = *instance.state;
  if (state.steps == 0) return;
  const auto now = [&](int j) { return state.latent[j]; };
  const auto before = [&](int j) { return state.latent[j] - view.dt * state.velocity[j]; };
  double a[1], b[1];
  if (mode < view.model.latents) {
    a[0] = now(mode);
    b[0] = before(mode);
  } else {
    map_output<false>(block, view.model.closure, now, mode - view.model.latents, shared, a);
    block.sync();
    map_output<false>(block, view.model.closure, before, mode - view.model.latents, shared, b);
  }
  if (block.thread() != 0) return;
  instance.rate[mode] = (a[0] - b[0]) / view.dt;
  instance.coefficient[mode] = a[0];
}

/// Coefficients and slopes da/dq where the velocity takes the latent.
template <typename Block>
GRAUPEL_HD void deformation_ahead(const Block& block, const RunView& view, const InstanceView& instance, int mode,
                                  BranchShared& shared) {
  const InstanceState& state = *instance.state;
  const int r = view.model.latents;
  const auto input = [&](int j) { return state.latent[j] + view.dt * state.velocity[j]; };
  double a[1 + most_latents];
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

/// Marks a node a lane, each once, and clears their sums; `node` -1: none. All lanes of the warp must call it.
template <typename Block>
GRAUPEL_HD void mark_warp(const Block& block, const InstanceView& instance, int64_t node, int32_t round,
                          BranchShared& shared) {
  using Mark = long long;
  const auto round_of = [](Mark value) { return static_cast<int32_t>(value >> 32); };
  Mark* const mark = instance.node_mark + (node < 0 ? 0 : node);
  const bool mine = node >= 0 && round_of(*mark) != round && round_of(block.max(mark, Mark{round} << 32)) != round;
  // One count for all lanes: adding one by one, thousands of threads would wait for each other.
  const uint32_t all = block.ballot(mine);
  if (all == 0) return;
  const int lane = block.thread() % warp_width, warp = block.thread() / warp_width;
  if (lane == 0) shared.first_place[warp] = block.add(&instance.state->node_count, ones_of(all));
  block.sync_warp();
  const int32_t place = shared.first_place[warp] + ones_of(all & ((uint32_t{1} << lane) - 1));
  block.sync_warp();
  if (!mine) return;
  for (int c = 0; c < mpm::channels; ++c) instance.sums[int64_t(place) * mpm::channels + c] = 0.0f;
  *mark = Mark{round} << 32 | place;
}

/// Marks the nodes that samples can read until they have moved by half a cell: their stencils and one node more on
/// every side; a warp a sample.
template <typename Block>
GRAUPEL_HD void mark_nodes(const Block& block, const RunView& view, const InstanceView& instance, int first_warp,
                           int warps, BranchShared& shared) {
  constexpr int width = 5;
  for (int s = first_warp; s < view.model.samples; s += warps) {
    const Vec<double, 3> x = sample_position(block, view.model, instance.reached, s);
    const Stencil stencil = stencil_at(instance, x.template cast<float>());
    if (!stencil.inside) continue;
    for (int first = 0; first < width * width * width; first += warp_width) {
      const int n = first + block.thread() % warp_width;
      const Vec<int, 3> at = stencil.base + Vec<int, 3>{n / (width * width) - 1, n / width % width - 1, n % width - 1};
      bool inside = n < width * width * width;
      for (int d = 0; d < 3; ++d) inside = inside && at[d] >= 0 && at[d] < instance.nodes[d];
      mark_warp(block, instance, inside ? node_number(instance.nodes, at) : -1, instance.state->round, shared);
    }
  }
}

/// Clears the sums of all marked nodes, or marks others.
template <typename Block>
GRAUPEL_HD void prepare_nodes(const Block& block, const RunView& view, const InstanceView& instance, int worker,
                              BranchShared& shared) {
  if (instance.state->due != 0) {
    mark_nodes(block, view, instance, worker * step_warps + block.thread() / warp_width,
               view.worker_blocks * step_warps, shared);
    return;
  }
  const int64_t sums = int64_t(instance.state->node_count) * mpm::channels;
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
  if (part < blocks.now) return deformation_now(block, view, instance, part, shared);
  part -= blocks.now;
  if (part >= blocks.stress + blocks.affine)
    return prepare_nodes(block, view, instance, part - blocks.stress - blocks.affine, shared);
  const bool stress = part < blocks.stress;
  const auto input = [&](int j) {
    return j < model.latents ? instance.state->latent[j] : instance.parameters[j - model.latents];
  };
  double value[1];
  map_output<false>(block, stress ? model.stress_map : model.affine_map, input, stress ? part : part - blocks.stress,
                    shared, value);
  if (block.thread() == 0) instance.map_rows[part] = value[0];
}

}  // namespace graupel::rom::device
