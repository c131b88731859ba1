// The three kernels of a substep on a GPU, one block of threads for one block of the grid: particle_to_grid
// (mpm/gpu/blocks/batch_scatter.h), update_grid, where every node adds the eight arenas that reach it, then gravity and
// contact, and grid_to_particle (mpm/gpu/blocks/batch_gather.h). Equal the phases of mpm/phases/. Gain of what decision
// 5 keeps, over the first form of these kernels, 1 M particles on an H200: jelly 316 -> 240, sand 305 -> 256, water 243
// -> 218 us a substep (docs/decisions/0005-gpu-tuning.md).
#pragma once

#include "mpm/gpu/blocks/batch_gather.h"
#include "mpm/gpu/blocks/batch_scatter.h"
#include "mpm/physics/node_update.h"

namespace graupel::mpm::batch {

inline constexpr int block_threads = 128;
inline constexpr int block_warps = block_threads / warp_width;

template <typename Block>
GRAUPEL_HD void particle_to_grid(const Block& block, const BatchView& view, ScatterShared<block_warps>& shared) {
  const int owner = block.index();
  if (owner >= view.counts->owners_to_run()) return;
  const OwnerBlock b = view.owners[owner];
  const SceneProgress& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  scatter_block<block_warps>(block, view.current_particles(), view.scenes[b.scene].view, b, control.dt, shared,
                             view.arenas + static_cast<int64_t>(owner) * halo_nodes);
}

/// Along each axis a node lies in the arena of its own block, and of the lower one (nodes 0..2) or the upper (node 3).
/// `part(corner, place)` is the sum of the arena beyond the bits of `corner`, at `place`; those of the other blocks.
struct NodeHalo {
  int shift[3];          ///< to the other block
  int own[3], other[3];  ///< place in the arenas of the own and the other block

  GRAUPEL_HD explicit NodeHalo(const Vec<int, 3>& c) {
    for (int d = 0; d < 3; ++d) {
      shift[d] = c[d] == 3 ? 1 : -1;
      own[d] = c[d] + 1;
      other[d] = c[d] == 3 ? 0 : c[d] + 5;
    }
  }
  GRAUPEL_HD int place(int corner) const {
    return halo_index(corner & 1 ? other[0] : own[0], corner >> 1 & 1 ? other[1] : own[1],
                      corner >> 2 ? other[2] : own[2]);
  }
};

/// Velocity and mass of a node from the sum of the arenas.
GRAUPEL_HD inline NodeSum moved_node(const SceneView<float>& scene, int32_t key, int inside, const NodeSum& sum,
                                     float dt) {
  if (!(sum.v[3] >= least_node_mass<float>)) return {};
  const Vec<float, 3> v = updated_velocity<false, 3>(scene, {}, key, inside, node_position<3>(scene.grid, key, inside),
                                                     Vec<float, 3>{sum.v[0], sum.v[1], sum.v[2]}, sum.v[3], dt);
  return {{v[0], v[1], v[2], sum.v[3]}};
}

/// One node: no barriers, so any number of them may share a block of threads.
GRAUPEL_HD inline void update_node(const BatchView& view, int64_t entry) {
  const int64_t number = entry / nodes_per_block<3>;
  if (number >= view.counts->nodes_to_run()) return;
  const OwnerBlock b = block_of_key(view, view.node_key[number]);
  const SceneProgress& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  const int inside = static_cast<int>(entry % nodes_per_block<3>);
  const NodeHalo halo(node_in_block<3>(inside));
  NodeSum sum = {};
  for (int corner = 0; corner < 8; ++corner) {
    const int32_t key = neighbor_key(view, b, corner & 1 ? halo.shift[0] : 0, corner >> 1 & 1 ? halo.shift[1] : 0,
                                     corner >> 2 ? halo.shift[2] : 0);
    const int32_t owner = key < 0 ? -1 : view.owner_of_key[key];
    if (owner < 0) continue;
    const NodeSum part = view.arenas[static_cast<int64_t>(owner) * halo_nodes + halo.place(corner)];
    for (int n = 0; n < 4; ++n) sum.v[n] += part.v[n];
  }
  view.nodes[entry] = moved_node(view.scenes[b.scene].view, b.key, inside, sum, control.dt);
}

struct GatherShared {
  NodeSum node[halo_nodes];
  int32_t neighbor[27];  ///< node block at (-1..1)^3, or -1
  StepReport report;
};

/// Which block, (-1..1)^3 as 0..26, and which of its nodes a node of a window is; n = x * 64 + y * 8 + z.
struct WindowNode {
  int corner = 0, inside = 0;
  GRAUPEL_HD explicit WindowNode(int n) {
    const int at[3] = {n / 64 + 3, n / 8 % 8 + 3, n % 8 + 3};  // node -1..6 of the block, plus 4
    for (int d = 0; d < 3; ++d) {
      corner = corner * 3 + at[d] / block_width;
      inside = inside * block_width + at[d] % block_width;
    }
  }
};

template <typename Block>
GRAUPEL_HD void grid_to_particle(const Block& block, const BatchView& view, GatherShared& shared) {
  const int owner = block.index();
  if (owner >= view.counts->owners_to_run()) return;
  const OwnerBlock b = view.owners[owner];
  const SceneProgress& control = view.controls[b.scene];
  if (control.phase != ScenePhase::running) return;
  const SceneView<float>& scene = view.scenes[b.scene].view;
  const float dt = control.dt;
  const int t = block.thread();
  if (t < 27) {
    const int32_t key = neighbor_key(view, b, t / 9 - 1, t / 3 % 3 - 1, t % 3 - 1);
    shared.neighbor[t] = key < 0 ? -1 : view.node_of_key[key];
  }
  if (t == 0) clear_report(shared.report);
  block.sync();
  for (int n = t; n < halo_nodes; n += block_threads) {
    const WindowNode node(n);
    const int64_t number = shared.neighbor[node.corner];
    shared.node[halo_index(n / 64, n / 8 % 8, n % 8)] =
        number < 0 ? NodeSum{} : view.nodes[number * nodes_per_block<3> + node.inside];
  }
  block.sync();
  advance_block(block, view.current_particles(), scene, b, dt, shared.node, shared.report);
  block.sync();
  if (t == 0) report_block(block, view, b.scene, shared.report, 1);
}

}  // namespace graupel::mpm::batch
