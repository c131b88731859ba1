// A whole segment of substeps in one kernel, for scenes so small that launches and loads take most of the time. Every
// owner block has a block of threads of its own, all of them at once on the GPU. A substep has one barrier among the
// blocks of a scene: after P2G, which leaves a block's sums in its arena in global memory. Then every block adds the
// arenas that reach its own 8^3 nodes and moves those nodes itself, in shared memory, before G2P. Neighbours move the
// same nodes again; that is less work than a second barrier.
//
// For equal steps only: a block does not know its neighbours' new state when it starts the next P2G. That a particle
// left its arena or went bad is told at the next barrier, where all blocks of the scene stop with the state of the
// substep before. Equals the three kernels (mpm/gpu/blocks/batch_kernels.h), to the byte. Gain: one scene of the recipe
// 53 -> 49 us a substep on an H200 (docs/decisions/0005-gpu-tuning.md).
#pragma once

#include "mpm/gpu/blocks/batch_kernels.h"

namespace graupel::mpm::batch {

inline constexpr int resident_threads = 256;
inline constexpr int resident_warps = resident_threads / warp_width;
inline constexpr uint32_t arrival_stop = 1u << 20;  ///< added to the number of arrivals by a block that must stop
inline constexpr int far_width = 5;                 ///< owner blocks at (-2..2)^3 reach the nodes of a window

struct ResidentShared {
  ScatterShared<resident_warps> scatter;
  NodeSum node[halo_nodes];
  int32_t owner[far_width * far_width * far_width];  ///< at (-2..2)^3, or -1
  int32_t block_key[27];                             ///< directory index at (-1..1)^3, or -1
  StepReport report;
  uint32_t arrivals;
};

/// What a block of threads knows for the whole segment.
struct Resident {
  OwnerBlock owner;
  int number;  ///< of the owner block
  int32_t blocks, substeps;
  float dt;
};

template <typename Block>
GRAUPEL_HD void find_neighbors(const Block& block, const BatchView& view, const OwnerBlock& b, ResidentShared& shared) {
  const int t = block.thread();
  if (t < far_width * far_width * far_width) {
    const int32_t key =
        neighbor_key(view, b, t / (far_width * far_width) - 2, t / far_width % far_width - 2, t % far_width - 2);
    shared.owner[t] = key < 0 ? -1 : view.owner_of_key[key];
  }
  if (t < 27) shared.block_key[t] = neighbor_in_scene(view, b, t / 9 - 1, t / 3 % 3 - 1, t % 3 - 1);
  if (t == 0) clear_report(shared.report);
}

/// Adds the arenas at every node of the window, then gravity and contact.
template <typename Block>
GRAUPEL_HD void move_window(const Block& block, const SceneView<float>& scene, const NodeSum* arenas, float dt,
                            ResidentShared& shared) {
  for (int n = block.thread(); n < halo_nodes; n += resident_threads) {
    const WindowNode node(n);
    const int32_t key = shared.block_key[node.corner];
    NodeSum sum = {};
    if (key >= 0) {
      const NodeHalo halo(node_in_block<3>(node.inside));
      const int at[3] = {node.corner / 9 + 1, node.corner / 3 % 3 + 1, node.corner % 3 + 1};
      NodeSum part[8];
      for (int corner = 0; corner < 8; ++corner) {
        const int x = at[0] + (corner & 1 ? halo.shift[0] : 0), y = at[1] + (corner >> 1 & 1 ? halo.shift[1] : 0),
                  z = at[2] + (corner >> 2 ? halo.shift[2] : 0);
        const int32_t owner = shared.owner[(x * far_width + y) * far_width + z];
        part[corner] = {};
        if (owner >= 0)
          part[corner] = block.fresh(arenas + static_cast<int64_t>(owner) * halo_nodes + halo.place(corner));
      }
      for (int corner = 0; corner < 8; ++corner)
        for (int c = 0; c < 4; ++c) sum.v[c] += part[corner].v[c];
      sum = moved_node(scene, key, node.inside, sum, dt);
    }
    shared.node[halo_index(n / 64, n / 8 % 8, n % 8)] = sum;
  }
}

/// Waits until all blocks of the scene have finished the P2G of substep `done`; returns whether one of them had to stop
/// after the substep before.
template <typename Block>
GRAUPEL_HD bool scene_barrier(const Block& block, uint32_t* arrivals, const Resident& own, int32_t done,
                              ResidentShared& shared) {
  block.sync();
  if (block.thread() == 0) {
    const bool stop = shared.report.left_halo > 0 || shared.report.bad_particle != no_bad_particle;
    block.fence();
    block.add(arrivals, stop ? arrival_stop + 1 : 1u);
    const auto all = static_cast<uint32_t>(own.blocks) * static_cast<uint32_t>(done + 1);
    uint32_t seen = block.fresh(arrivals);
    while (seen % arrival_stop < all) {
      block.pause();
      seen = block.fresh(arrivals);
    }
    block.fence();
    shared.arrivals = seen;
  }
  block.sync();
  return shared.arrivals >= arrival_stop;
}

/// The report keeps sums over the segment, and the speeds of its last two substeps.
GRAUPEL_HD inline void begin_substep_report(StepReport& report) {
  report.before_speed2 = report.speed2;
  report.before_sound_speed = report.sound_speed;
  if (report.sound_speed > report.peak_sound_speed) report.peak_sound_speed = report.sound_speed;
  report.speed2 = 0;
  report.sound_speed = 0;
  report.over_courant = 0;
}

/// The substeps until the next sort or the end of the frame, for the owner block with this block's number. Nothing
/// happens when there are more owner blocks than blocks of threads.
template <typename Block>
GRAUPEL_HD void run_segment(const Block& block, const BatchView& view, ResidentShared& shared) {
  Resident own;
  own.number = block.index();
  const int32_t owners = view.counts->owners_to_run();
  if (own.number >= owners || owners > block.blocks()) return;
  own.owner = view.owners[own.number];
  const SceneProgress& control = view.controls[own.owner.scene];
  if (control.phase != ScenePhase::running) return;
  const BatchScene& scene = view.scenes[own.owner.scene];
  const auto left = control.equal_substeps - control.frame_substeps;
  const int32_t sorted = control.sort_interval - control.since_sort;
  own.substeps = left < sorted ? left : sorted;
  own.blocks = control.blocks;
  own.dt = control.dt;
  const ParticleView<float>& p = view.current_particles();
  find_neighbors(block, view, own.owner, shared);
  int32_t done = 0;
  for (;; ++done) {
    NodeSum* arenas = view.arenas + static_cast<int64_t>(done & 1) * block.blocks() * halo_nodes;
    if (done == own.substeps) break;
    scatter_block<resident_warps>(block, p, scene.view, own.owner, own.dt, shared.scatter,
                                  arenas + static_cast<int64_t>(own.number) * halo_nodes);
    if (scene_barrier(block, view.arrivals + own.owner.scene, own, done, shared)) break;
    move_window(block, scene.view, arenas, own.dt, shared);
    if (block.thread() == 0 && done > 0) begin_substep_report(shared.report);
    block.sync();
    advance_block(block, p, scene.view, own.owner, own.dt, shared.node, shared.report);
    block.sync();
  }
  if (block.thread() == 0) report_block(block, view, own.owner.scene, shared.report, done);
}

}  // namespace graupel::mpm::batch
