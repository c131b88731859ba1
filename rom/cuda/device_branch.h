// The first kernel of a reduced-order model's step. A warp evaluates an output of a coefficient map: of stress and
// affine velocity at (q, mu), of the deformation's closure at q and, with its slope, at q* = q + dt q', where the fit
// starts. Other blocks clear the sums of nodes or, where that is due, mark the nodes that samples can read.
#pragma once

#include "rom/cuda/device_step.h"

namespace graupel::rom::device {

/// Centres whose distances a block keeps at once.
inline constexpr int branch_centers = 1024;
struct BranchShared {
  double distance[branch_centers];
};

/// What a block of branches evaluates: a map, and where.
struct BranchTask {
  const MapView* map;
  double ahead;          ///< time along the latent's velocity [s]
  bool with_parameters;  ///< inputs are (q, mu), else q
};

GRAUPEL_HD inline double branch_input(const ModelView& model, const InstanceView& instance, const BranchTask& task,
                                      int j) {
  if (j >= model.latents) return instance.parameters[j - model.latents];
  return instance.state->latent[j] + task.ahead * instance.state->velocity[j];
}

/// c_k(z) and, for `slope`, dc_k/dz_j of a warp's output k, in full in all lanes; all warps of the block must call it,
/// with any output.
template <bool slope, typename Block>
GRAUPEL_HD void map_output(const Block& block, const ModelView& model, const InstanceView& instance,
                           const BranchTask& task, int output, BranchShared& shared, double* sums) {
  constexpr int most = slope ? most_latents : 0;
  const MapView& map = *task.map;
  const int lane = block.thread() % warp_width;
  double radial[1 + most] = {};
  for (int first = 0; first < map.count; first += branch_centers) {
    const int count = map.count - first < branch_centers ? map.count - first : branch_centers;
    block.sync();
    for (int i = block.thread(); i < count; i += block.threads()) {
      double r2 = 0;
      for (int j = 0; j < map.inputs; ++j) {
        const double d = held(map, j, standardised(map, j, branch_input(model, instance, task, j))) -
                         map.centers[int64_t(j) * map.count + first + i];
        r2 += d * d;
      }
      shared.distance[i] = std::sqrt(r2);
    }
    block.sync();
    if (output >= map.outputs) continue;
    const double* const weights = map.weights + int64_t(output) * map.count + first;
    double inside[1 + most];
    GRAUPEL_UNROLL
    for (int j = 0; j < most; ++j)
      if (j < map.inputs) inside[j] = held(map, j, standardised(map, j, branch_input(model, instance, task, j)));
    for (int i = lane; i < count; i += warp_width) {
      const double r = shared.distance[i], w = weights[i];
      radial[0] += w * r * r * r;
      GRAUPEL_UNROLL
      for (int j = 0; j < most; ++j)
        if (j < map.inputs) radial[1 + j] += 3 * w * r * (inside[j] - map.centers[int64_t(j) * map.count + first + i]);
    }
  }
  GRAUPEL_UNROLL
  for (int j = 0; j <= most; ++j)
    if (j <= map.inputs) radial[j] = sum_of_warp(block, radial[j]);
  if (output >= map.outputs) return;
  const double* const linear = map.linear + int64_t(output) * (1 + map.inputs);
  sums[0] = linear[0] + radial[0];
  for (int j = 0; j < map.inputs; ++j) {
    const double y = standardised(map, j, branch_input(model, instance, task, j));
    sums[0] += linear[1 + j] * y;
    // The radial part is constant where an input is held.
    if constexpr (slope) sums[1 + j] = (linear[1 + j] + (held(map, j, y) == y ? radial[1 + j] : 0.0)) * map.scale[j];
  }
}

/// Blocks of each part, a warp an output.
struct BranchBlocks {
  int stress, affine, now, ahead;
  GRAUPEL_HD explicit BranchBlocks(const ModelView& model)
      : stress((model.stress_map.outputs + step_warps - 1) / step_warps),
        affine((model.affine_map.outputs + step_warps - 1) / step_warps),
        now((model.deformation_modes + step_warps - 1) / step_warps),
        ahead(now) {}
  GRAUPEL_HD int all() const { return stress + affine + now + ahead; }
};

/// Coefficients of the deformation at q, and their change since the last step over dt; before the first step both are
/// those of the start.
template <typename Block>
GRAUPEL_HD void deformation_now(const Block& block, const RunView& view, const InstanceView& instance, int mode,
                                BranchShared& shared) {
  const ModelView& model = view.model;
  const int output = mode < model.latents ? model.closure.outputs : mode - model.latents;  // past the end: none
  double a[1];
  map_output<false>(block, model, instance, {&model.closure, 0.0, false}, output, shared, a);
  if (mode >= model.deformation_modes || block.thread() % warp_width != 0 || instance.state->steps == 0) return;
  if (mode < model.latents) a[0] = instance.state->latent[mode];
  instance.rate[mode] = (a[0] - instance.coefficient[mode]) / view.dt;
  instance.coefficient[mode] = a[0];
}

/// Coefficients and slopes da/dq where the velocity takes the latent.
template <typename Block>
GRAUPEL_HD void deformation_ahead(const Block& block, const RunView& view, const InstanceView& instance, int mode,
                                  BranchShared& shared) {
  const ModelView& model = view.model;
  const BranchTask task{&model.closure, view.dt, false};
  const int r = model.latents, output = mode < r ? model.closure.outputs : mode - r;
  double a[1 + most_latents] = {};
  map_output<true>(block, model, instance, task, output, shared, a);
  if (mode >= model.deformation_modes || block.thread() % warp_width != 0) return;
  if (mode < r) {
    a[0] = branch_input(model, instance, task, mode);
    for (int j = 0; j < r; ++j) a[1 + j] = j == mode ? 1.0 : 0.0;
  }
  instance.ahead[mode] = a[0];
  for (int j = 0; j < r; ++j) instance.slope[mode * r + j] = a[1 + j];
}

/// Marks a node, once, and clears its sums.
template <typename Block>
GRAUPEL_HD void mark_node(const Block& block, const InstanceView& instance, int64_t node, int32_t round) {
  using Mark = long long;
  Mark* const mark = instance.node_mark + node;
  const auto round_of = [](Mark value) { return static_cast<int32_t>(value >> 32); };
  constexpr Mark taken = 0xffffffff;  // by a thread that has not numbered it yet
  if (round_of(*mark) == round || round_of(block.max(mark, Mark{round} << 32 | taken)) == round) return;
  const int32_t number = block.add(&instance.state->node_count, int32_t{1});
  for (int c = 0; c < mpm::channels; ++c) instance.sums[int64_t(number) * mpm::channels + c] = 0.0f;
  *mark = Mark{round} << 32 | number;
}

/// Marks the nodes that samples can read until they have moved by half a cell: their stencils and one node more on
/// every side; a warp a sample.
template <typename Block>
GRAUPEL_HD void mark_nodes(const Block& block, const RunView& view, const InstanceView& instance, int first_warp,
                           int warps) {
  constexpr int width = 5;
  for (int s = first_warp; s < view.model.samples; s += warps) {
    const Vec<double, 3> x = sample_position(block, view.model, instance.reached, s);
    const Stencil stencil = stencil_at(instance, x.template cast<float>());
    if (!stencil.inside) continue;
    for (int n = block.thread() % warp_width; n < width * width * width; n += warp_width) {
      const Vec<int, 3> at = stencil.base + Vec<int, 3>{n / (width * width) - 1, n / width % width - 1, n % width - 1};
      bool inside = true;
      for (int d = 0; d < 3; ++d) inside = inside && at[d] >= 0 && at[d] < instance.nodes[d];
      if (inside) mark_node(block, instance, node_number(instance.nodes, at), instance.state->round);
    }
  }
}

/// Clears the sums of all marked nodes, or marks others.
template <typename Block>
GRAUPEL_HD void prepare_nodes(const Block& block, const RunView& view, const InstanceView& instance, int worker) {
  if (instance.state->due != 0) {
    mark_nodes(block, view, instance, worker * step_warps + block.thread() / warp_width,
               view.worker_blocks * step_warps);
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
  const int warp = block.thread() / warp_width;
  int part = block.index() % per_instance;
  if (part < blocks.ahead) return deformation_ahead(block, view, instance, part * step_warps + warp, shared);
  part -= blocks.ahead;
  if (part < blocks.now) return deformation_now(block, view, instance, part * step_warps + warp, shared);
  part -= blocks.now;
  if (part >= blocks.stress + blocks.affine)
    return prepare_nodes(block, view, instance, part - blocks.stress - blocks.affine);
  const bool stress = part < blocks.stress;
  const MapView& map = stress ? model.stress_map : model.affine_map;
  const int output = (stress ? part : part - blocks.stress) * step_warps + warp;
  double value[1];
  map_output<false>(block, model, instance, {&map, 0.0, true}, output, shared, value);
  if (output < map.outputs && block.thread() % warp_width == 0)
    instance.map_rows[(stress ? 0 : model.stress_map.outputs) + output] = value[0];
}

}  // namespace graupel::rom::device
