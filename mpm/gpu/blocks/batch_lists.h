// Sorting the particles of a batch by block and cell, and listing the blocks in use; items for parallel loops. Between
// them stand a stable sort by key and the selection of marked items (BatchSolver::sort).
#pragma once

#include "mpm/gpu/blocks/batch_owner_blocks.h"
#include "mpm/gpu/blocks/step_control.h"
#include "mpm/physics/particle_motion.h"

namespace graupel::mpm::batch {

inline constexpr int cells_per_block = 64;

struct WriteSortKeys {
  BatchView view;
  uint32_t* key;
  int32_t* slots;

  GRAUPEL_HD int32_t scene_of(int32_t source_index) const {
    int32_t low = 0, high = view.scene_count - 1;
    while (low < high) {
      const int32_t middle = (low + high + 1) / 2;
      if (view.scenes[middle].first_particle <= source_index)
        low = middle;
      else
        high = middle - 1;
    }
    return low;
  }
  /// Scenes that run on keep their keys, and so their order.
  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<float>& p = view.current_particles();
    const int32_t scene = scene_of(p.source_index.get(slot));
    slots[slot] = static_cast<int32_t>(slot);
    if (view.controls[scene].phase == ScenePhase::running) {
      key[slot] = view.sort_key[slot];
      return;
    }
    const GridGeometry<float, 3>& grid = view.scenes[scene].view.grid;
    const Vec<int, 3> base = base_node(grid.local(p.position.vec(slot)));
    Vec<int, 3> block;
    int cell = 0;
    for (int d = 0; d < 3; ++d) {
      block[d] = base[d] / block_width;
      cell = cell * block_width + base[d] % block_width;
    }
    const auto full_key = static_cast<uint32_t>(scene * view.directory + grid.directory_index(block));
    key[slot] = full_key * cells_per_block + static_cast<uint32_t>(cell);
  }
};

/// Copies every particle from its old slot to the other arrays.
struct PermuteBatch {
  BatchView view;
  const int32_t* old_slot;

  template <typename V, int K>
  GRAUPEL_HD static void copy(const TiledView<V, K>& from, const TiledView<V, K>& to, int64_t old, int64_t slot) {
    const V* source = from.at(old);
    V* target = to.at(slot);
    for (int k = 0; k < K; ++k) target[k * tile] = source[k * tile];
  }
  GRAUPEL_HD void operator()(int64_t slot) const {
    const ParticleView<float>&from = view.current_particles(), &to = view.particles[1 - view.counts->current];
    const int64_t old = old_slot[slot];
    copy(from.position, to.position, old, slot);
    copy(from.velocity, to.velocity, old, slot);
    copy(from.affine_velocity, to.affine_velocity, old, slot);
    copy(from.deformation_gradient, to.deformation_gradient, old, slot);
    copy(from.stress, to.stress, old, slot);
    copy(from.internal, to.internal, old, slot);
    copy(from.volume, to.volume, old, slot);
    copy(from.material, to.material, old, slot);
    copy(from.source_index, to.source_index, old, slot);
  }
};

/// Per scene: the other arrays are the present ones from now on, and no block is counted yet.
struct SwapBatch {
  BatchView view;
  GRAUPEL_HD void operator()(int64_t scene) const {
    view.controls[scene].blocks = 0;
    if (scene > 0) return;
    view.counts->current = 1 - view.counts->current;
    view.counts->overflow = 0;
  }
};

struct MarkHeads {
  const uint32_t* key;
  uint8_t* head;
  GRAUPEL_HD void operator()(int64_t slot) const {
    head[slot] = slot == 0 || key[slot] / cells_per_block != key[slot - 1] / cells_per_block;
  }
};

/// The owner block with a number, whose first slots are known.
GRAUPEL_HD inline OwnerBlock named_owner(const BatchView& view, int32_t owner) {
  OwnerBlock b = block_of_key(view, static_cast<int32_t>(view.sort_key[view.start[owner]] / cells_per_block));
  b.begin = view.start[owner];
  b.end = owner + 1 < view.counts->owner ? view.start[owner + 1] : view.particle_count;
  return b;
}

/// Names the owner blocks, counts those of each scene, and marks the blocks that their arenas reach.
template <typename Atomics>
struct NameOwners {
  BatchView view;
  Atomics atomics;
  GRAUPEL_HD void operator()(int64_t owner) const {
    const int32_t count = view.counts->owner;
    if (owner >= count) return;
    if (count > view.owner_capacity) {
      if (owner == 0) view.counts->overflow = 1;
      return;
    }
    const OwnerBlock b = named_owner(view, static_cast<int32_t>(owner));
    view.owners[owner] = b;
    view.owner_of_key[b.scene * view.directory + b.key] = static_cast<int32_t>(owner);
    atomics.add(&view.controls[b.scene].blocks, 1);
    for (int n = 0; n < 27; ++n) {
      const int32_t key = neighbor_key(view, b, n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
      if (key >= 0) view.node_flag[key] = 1;
    }
  }
};

struct NameNodes {
  BatchView view;
  GRAUPEL_HD void operator()(int64_t number) const {
    const int32_t count = view.counts->node;
    if (number >= count) return;
    if (count > view.node_capacity) {
      if (number == 0) view.counts->overflow = 1;
      return;
    }
    view.node_of_key[view.node_key[number]] = static_cast<int32_t>(number);
  }
};

struct ResumeScenes {
  BatchView view;
  GRAUPEL_HD void operator()(int64_t scene) const {
    view.arrivals[scene] = 0;
    SceneProgress& control = view.controls[scene];
    if (control.phase != ScenePhase::unsorted || view.counts->overflow) return;
    control.phase = ScenePhase::running;
    control.since_sort = 0;
  }
};

struct BeginFrame {
  BatchView view;
  GRAUPEL_HD void operator()(int64_t scene) const { begin_frame(view.scenes[scene], view.controls[scene]); }
};

/// Positions and velocities in the order of the sources, [n, 3] each.
struct PackParticles {
  ParticleView<float> particles;
  float *position, *velocity;
  GRAUPEL_HD void operator()(int64_t slot) const {
    const int64_t place = particles.source_index.get(slot);
    const Vec<float, 3> x = particles.position.vec(slot), v = particles.velocity.vec(slot);
    for (int d = 0; d < 3; ++d) {
      position[3 * place + d] = x[d];
      velocity[3 * place + d] = v[d];
    }
  }
};
struct PackFrame {
  BatchView view;
  float *position, *velocity;
  GRAUPEL_HD void operator()(int64_t slot) const { PackParticles{view.current_particles(), position, velocity}(slot); }
};

}  // namespace graupel::mpm::batch
