// Names the owner blocks of sorted particles in one kernel of one block of threads, for batches so small that launches
// cost more than work: what SwapBatch, MarkHeads, NameOwners and ResumeScenes of mpm/gpu/blocks/batch_lists.h do,
// without the lists of node blocks.
#pragma once

#include "core/parallel/thread_block.h"
#include "mpm/gpu/blocks/batch_lists.h"

namespace graupel::mpm::batch {

inline constexpr int list_threads = 1024;

struct ListShared {
  int32_t heads[list_threads / warp_width];  ///< of each warp's 32 particles
  int32_t owners;                            ///< named so far
};

GRAUPEL_HD inline int32_t bits_set(uint32_t word) {
  int32_t n = 0;
  for (; word != 0; word &= word - 1) ++n;
  return n;
}

/// `owner_of_key` must be cleared to -1.
template <typename Block>
GRAUPEL_HD void list_owners(const Block& block, const BatchView& view, ListShared& shared) {
  const int t = block.thread(), warp = t / warp_width, lane = t % warp_width;
  for (int scene = t; scene < view.scene_count; scene += list_threads) SwapBatch{view}(scene);
  if (t == 0) shared.owners = 0;
  for (int32_t first = 0; first < view.particle_count; first += list_threads) {
    block.sync();
    const int32_t slot = first + t;
    bool head = false;
    if (slot < view.particle_count) {
      const uint32_t key = view.sort_key[slot] / cells_per_block;
      head = slot == 0 || key != view.sort_key[slot - 1] / cells_per_block;
    }
    const uint32_t heads = block.ballot(head);
    if (lane == 0) shared.heads[warp] = bits_set(heads);
    block.sync();
    int32_t owner = shared.owners + bits_set(heads & ((uint32_t{1} << lane) - 1)), all = 0;
    for (int w = 0; w < list_threads / warp_width; ++w) {
      if (w == warp) owner += all;
      all += shared.heads[w];
    }
    if (head) {
      const auto key = static_cast<int32_t>(view.sort_key[slot] / cells_per_block);
      view.start[owner] = slot;
      view.owner_of_key[key] = owner;
      block.add(&view.controls[key / view.directory].blocks, 1);
    }
    block.sync();
    if (t == 0) shared.owners += all;
  }
  block.sync();
  if (t == 0) {
    view.counts->owner = shared.owners;
    view.counts->overflow = shared.owners > view.owner_capacity;
  }
  block.sync();
  const int32_t named = view.counts->owners_to_run();
  for (int32_t owner = t; owner < named; owner += list_threads) view.owners[owner] = named_owner(view, owner);
  for (int scene = t; scene < view.scene_count; scene += list_threads) ResumeScenes{view}(scene);
}

}  // namespace graupel::mpm::batch
