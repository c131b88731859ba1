// The first kernel of a reduced-order model's step. A block evaluates one or some outputs of a coefficient map: of
// stress and affine velocity at (q, mu), of the deformation's closure at q, at q - dt q', where the step before began,
// and, with its slope, at q* = q + dt q', where the fit starts. Other blocks clear the sums of nodes or, where that is
// due, mark the blocks of nodes that samples can read.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

inline constexpr int most_inputs = 2 * most_closure_latents;  ///< latents and parameters
/// Outputs of a map that a block evaluates at once, from the same distances to the centres. One at a time is quickest
/// where an instance is alone: all wait for the slowest block.
struct OneOutput {
  static constexpr int outputs = 1, slopes = 1;
};
/// Of many instances, whose blocks wait for each other's reads. Sums are the same bits.
struct ManyOutputs {
  static constexpr int outputs = 8;  ///< of values alone
  static constexpr int slopes = 2;   ///< of values with slopes, 1 + r sums each
};
inline constexpr int most_sums = ManyOutputs::slopes * (1 + most_closure_latents);
static_assert(most_sums >= ManyOutputs::outputs);

struct BranchShared {
  double place[most_inputs], inside[most_inputs];  ///< standardised input, and the same clamped to the centres' box
  double sums[step_warps][most_sums];
  int32_t first_place[step_warps];  ///< of the nodes that a warp marks at once
};

/// c_k(z) and, for `slope`, dc_k/dz_j, of outputs first .. first + group - 1 by a block: to(k, c_k, dc_k/dz) in a
/// thread each. `input(j)` is z_j.
template <bool slope, int group, typename Block, typename Input, typename To>
GRAUPEL_HD void map_outputs(const Block& block, const MapView& map, const Input& input, int first_output,
                            BranchShared& shared, const To& to) {
  constexpr int most = slope ? most_closure_latents : 0, sums = 1 + most;
  const int lane = block.thread() % warp_width, warp = block.thread() / warp_width;
  for (int j = block.thread(); j < map.inputs; j += block.threads()) {
    shared.place[j] = standardised(map, j, input(j));
    shared.inside[j] = clamped(map, j, shared.place[j]);
  }
  block.sync();
  const int outputs = map.outputs - first_output < group ? map.outputs - first_output : group;
  constexpr int batch = group == 1 ? 4 : 2;  // centres of a thread at once: they are waited for together
  double radial[group][sums] = {};
  const double* weights[group];
  GRAUPEL_UNROLL
  for (int o = 0; o < group; ++o) weights[o] = map.weights + int64_t(first_output + (o < outputs ? o : 0)) * map.count;
  for (int first = block.thread(); first < map.count; first += batch * block.threads()) {
    const double* center[batch];
    double r2[batch] = {}, w[group][batch];
    GRAUPEL_UNROLL
    for (int b = 0; b < batch; ++b) {
      const int i = first + b * block.threads();
      center[b] = map.centers + (i < map.count ? i : first);
      GRAUPEL_UNROLL
      for (int o = 0; o < group; ++o) w[o][b] = i < map.count ? weights[o][i] : 0.0;
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
      const double r = std::sqrt(r2[b]), cube = r2[b] * r;
      GRAUPEL_UNROLL
      for (int o = 0; o < group; ++o) {
        radial[o][0] += w[o][b] * cube;
        w[o][b] *= 3 * r;
      }
    }
    GRAUPEL_UNROLL
    for (int j = 0; j < most; ++j) {
      if (j >= map.inputs) continue;
      GRAUPEL_UNROLL
      for (int b = 0; b < batch; ++b) {
        const double d = shared.inside[j] - center[b][int64_t(j) * map.count];
        GRAUPEL_UNROLL
        for (int o = 0; o < group; ++o) radial[o][1 + j] += w[o][b] * d;
      }
    }
  }
  GRAUPEL_UNROLL
  for (int o = 0; o < group; ++o) {
    GRAUPEL_UNROLL
    for (int j = 0; j < sums; ++j) {
      if (j > map.inputs) continue;
      const double sum = sum_of_warp(block, radial[o][j]);
      if (lane == 0) shared.sums[warp][o * sums + j] = sum;
    }
  }
  block.sync();
  if (block.thread() >= outputs) return;
  const int o = block.thread();
  const double* const linear = map.linear + int64_t(first_output + o) * (1 + map.inputs);
  double value = linear[0], steep[sums] = {};
  for (int w = 0; w < step_warps; ++w) value += shared.sums[w][o * sums];
  for (int j = 0; j < map.inputs; ++j) {
    value += linear[1 + j] * shared.place[j];
    if constexpr (slope) {
      double sum = linear[1 + j];
      // The radial part is constant where an input is clamped.
      for (int w = 0; w < step_warps && shared.inside[j] == shared.place[j]; ++w)
        sum += shared.sums[w][o * sums + 1 + j];
      steep[j] = sum * map.scale[j];
    }
  }
  to(first_output + o, value, steep);
}

/// Blocks of each part of an instance.
template <typename Group>
struct BranchBlocks {
  int stress, affine, current, earlier, ahead;
  GRAUPEL_HD explicit BranchBlocks(const ModelView& model)
      : stress(blocks_of(model.stress_map.outputs, Group::outputs)),
        affine(blocks_of(model.affine_map.outputs, Group::outputs)),
        current(at_least_one(blocks_of(closure_outputs(model), Group::outputs))),
        earlier(current),
        ahead(at_least_one(blocks_of(closure_outputs(model), Group::slopes))) {}
  GRAUPEL_HD int all() const { return stress + affine + current + earlier + ahead; }

 private:
  GRAUPEL_HD static int blocks_of(int outputs, int group) { return (outputs + group - 1) / group; }
  /// The first block has the modes that are latents.
  GRAUPEL_HD static int at_least_one(int blocks) { return blocks > 0 ? blocks : 1; }
  GRAUPEL_HD static int closure_outputs(const ModelView& model) { return model.deformation_modes - model.latents; }
};

/// Whether a launch takes ManyOutputs, and two blocks of the gather kernel share a multiprocessor.
inline bool has_many_instances(const RunView& view) {
  constexpr int few = 3;  // instances whose blocks of an output each are all at work at once
  return view.instance_count > few;
}
/// Blocks of a launch.
template <typename Group>
int branch_blocks(const RunView& view) {
  return view.instance_count * (BranchBlocks<Group>(view.model).all() + view.worker_blocks);
}

/// Coefficients of the deformation's modes at the latent `input`, a part of the block's number; before the first step
/// those of the start stay.
template <int group, typename Block, typename Input>
GRAUPEL_HD void deformation_at(const Block& block, const RunView& view, const InstanceView& instance,
                               const Input& input, int part, BranchShared& shared, double* to) {
  if (instance.state->steps == 0) return;
  const int r = view.model.latents;
  if (part == 0)
    for (int k = block.thread(); k < r; k += block.threads()) to[k] = input(k);
  if (part * group >= view.model.deformation_modes - r) return;
  map_outputs<false, group>(block, view.model.closure, input, part * group, shared,
                            [&](int k, double value, const double*) { to[r + k] = value; });
}

/// Coefficients and slopes da/dq where the velocity takes the latent.
template <int group, typename Block>
GRAUPEL_HD void deformation_ahead(const Block& block, const RunView& view, const InstanceView& instance, int part,
                                  BranchShared& shared) {
  const InstanceState& state = *instance.state;
  const int r = view.model.latents;
  const auto input = [&](int j) { return state.latent[j] + view.dt * state.velocity[j]; };
  if (part == 0)
    for (int k = block.thread(); k < r; k += block.threads()) {
      instance.ahead[k] = input(k);
      for (int j = 0; j < r; ++j) instance.slope[k * r + j] = j == k ? 1.0 : 0.0;
    }
  if (part * group >= view.model.deformation_modes - r) return;
  map_outputs<true, group>(block, view.model.closure, input, part * group, shared,
                           [&](int k, double value, const double* steep) {
                             instance.ahead[r + k] = value;
                             for (int j = 0; j < r; ++j) instance.slope[(r + k) * r + j] = steep[j];
                           });
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

template <typename Group, typename Block>
GRAUPEL_HD void branch(const Block& block, const RunView& view, BranchShared& shared) {
  const ModelView& model = view.model;
  const BranchBlocks<Group> blocks(model);
  const int per_instance = blocks.all() + view.worker_blocks;
  const InstanceView& instance = view.instances[block.index() / per_instance];
  if (instance.state->status != RunStatus::running) return;
  int part = block.index() % per_instance;
  if (part < blocks.ahead) return deformation_ahead<Group::slopes>(block, view, instance, part, shared);
  part -= blocks.ahead;
  const InstanceState& state = *instance.state;
  if (part < blocks.current) {
    const auto current = [&](int j) { return state.latent[j]; };
    return deformation_at<Group::outputs>(block, view, instance, current, part, shared, instance.coefficient);
  }
  part -= blocks.current;
  if (part < blocks.earlier) {
    const auto earlier = [&](int j) { return state.latent[j] - view.dt * state.velocity[j]; };
    return deformation_at<Group::outputs>(block, view, instance, earlier, part, shared, instance.earlier);
  }
  part -= blocks.earlier;
  if (part >= blocks.stress + blocks.affine)
    return prepare_nodes(block, view, instance, part - blocks.stress - blocks.affine, shared);
  const bool stress = part < blocks.stress;
  const auto input = [&](int j) {
    return j < model.latents ? state.latent[j] : instance.parameters[j - model.latents];
  };
  double* const rows = instance.map_rows + (stress ? 0 : model.stress_map.outputs);
  map_outputs<false, Group::outputs>(block, stress ? model.stress_map : model.affine_map, input,
                                     (stress ? part : part - blocks.stress) * Group::outputs, shared,
                                     [&](int k, double value, const double*) { rows[k] = value; });
}

}  // namespace graupel::rom::device
