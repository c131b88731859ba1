// The part of a block of threads in the frame of a small scene, and what it keeps in shared memory.
#pragma once

#include <type_traits>

#include "core/parallel/thread_block.h"
#include "mpm/gpu/blocks/batch_report.h"
#include "mpm/gpu/small/small_scene_view.h"

namespace graupel::mpm::small {

inline constexpr int threads = 256;
inline constexpr int warps = threads / warp_width;
inline constexpr int particle_lanes = 8;  ///< lanes of a particle
inline constexpr int stencil_nodes = 27;
inline constexpr uint32_t arrival_stop = 1u << 20;  ///< added to the number of arrivals by a block that must stop

/// A particle between reading and adding. Odd lengths, so that lanes with a particle each meet different banks.
struct Moment {
  float value[12];  ///< sum of w v, then of w v (x_i - x_p)^T / dx row by row
  float pad;
};
struct Contribution {
  float fx[3];
  int32_t base;
  float row[4][4];  ///< sum of channel c at node (i, j, k) of the stencil: w (row[c] . (1, i, j, k)), in units
  float pad;
};
union Staged {
  Moment moment;
  Contribution contribution;
};
struct Shared {
  Staged staged[warps][warp_width];
  BatchScene scene;
  SmallScene small;
  int32_t node[stencil_nodes];  ///< place of every node of a stencil, from that of its base node
  StepReport report;
  uint32_t arrivals;
};

struct ChangingShared : Shared {
  ChangingScene changing;
  MovingObstacleView<float> moving[2];  ///< in even and odd substeps
};
template <typename View>
using SharedFor = std::conditional_t<View::changes, ChangingShared, Shared>;

/// The part of a block of threads in the frame of one scene. `ViewOf` is SmallBatchView or ChangingBatchView.
template <typename Block, typename ViewOf>
struct Worker {
  using View = ViewOf;
  const Block& block;
  const View& view;
  SharedFor<View>& shared;
  const BatchScene& scene;  ///< copies in shared memory
  const SmallScene& small;
  int32_t number;      ///< of the scene
  int32_t blocks;      ///< of the group
  int32_t member;      ///< this block's place among them
  int32_t chunk_size;  ///< particles that a warp takes at once, a multiple of four
  float dt;
  int32_t step = 0;                   ///< number of the substep in its frame
  float speed2 = 0, sound_speed = 0;  ///< largest of this thread's particles in a substep
  float before_speed2 = 0, before_sound_speed = 0, peak_sound_speed = 0;

  GRAUPEL_HD int lane() const { return block.thread() % warp_width; }
  GRAUPEL_HD Staged* staged() const { return shared.staged[block.thread() / warp_width]; }

  /// Calls work(first, count) for every chunk of this warp: particles first .. first + count - 1 of the scene.
  template <typename Work>
  GRAUPEL_HD void for_chunks(const Work& work) const {
    const int32_t own_warps = block.threads() / warp_width, stride = blocks * own_warps * chunk_size;
    for (int32_t first = (member * own_warps + block.thread() / warp_width) * chunk_size; first < small.count;
         first += stride)
      work(first, small.count - first < chunk_size ? small.count - first : chunk_size);
  }

  /// Waits for the blocks of the scene, the n-th time (from 1); whether one of them had to stop.
  GRAUPEL_HD bool grid_barrier(int32_t n) const {
    block.sync();
    if (block.thread() == 0) {
      uint32_t* const arrivals = view.arrivals + number;
      block.arrive(arrivals, shared.report.bad_particle != no_bad_particle ? arrival_stop + 1 : 1u);
      const auto all = static_cast<uint32_t>(blocks) * static_cast<uint32_t>(n);
      uint32_t seen = block.fresh(arrivals);
      while (seen % arrival_stop < all) {
        block.pause();
        seen = block.fresh(arrivals);
      }
      shared.arrivals = seen;
      shared.report.over_courant = 0;  // only those of a frame's last substep count
    }
    block.sync();
    return shared.arrivals >= arrival_stop;
  }
};

/// Place of a node in the grid.
GRAUPEL_HD inline int32_t place_of(const SmallScene& small, const Vec<int, 3>& node) {
  return (node[0] * small.nodes[1] + node[1]) * small.nodes[2] + node[2];
}

}  // namespace graupel::mpm::small
