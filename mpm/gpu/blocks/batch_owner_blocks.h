// The blocks of a batch as kernels see them: which scene and place a home block has, its neighbours, and where its
// particles lie in its arena.
#pragma once

#include "mpm/bspline.h"
#include "mpm/gpu/blocks/batch_view.h"

namespace graupel::mpm::batch {

/// The block with a key of the batch, without particles.
GRAUPEL_HD inline HomeBlock block_of_key(const BatchView& view, int32_t full_key) {
  HomeBlock b{};
  b.scene = full_key / view.directory;
  b.key = full_key - b.scene * view.directory;
  b.at = view.scenes[b.scene].view.grid.block_of(b.key);
  return b;
}

/// Directory index of the block at `at` + (x, y, z) in its scene, or -1 outside the directory.
GRAUPEL_HD inline int32_t neighbor_in_scene(const BatchView& view, const HomeBlock& b, int x, int y, int z) {
  const GridGeometry<float, 3>& grid = view.scenes[b.scene].view.grid;
  const Vec<int, 3> at = {b.at[0] + x, b.at[1] + y, b.at[2] + z};
  for (int d = 0; d < 3; ++d)
    if (at[d] < 0 || at[d] >= grid.blocks[d]) return -1;
  return grid.directory_index(at);
}

/// The same as a key of the batch.
GRAUPEL_HD inline int32_t neighbor_key(const BatchView& view, const HomeBlock& b, int x, int y, int z) {
  const int32_t key = neighbor_in_scene(view, b, x, y, z);
  return key < 0 ? -1 : b.scene * view.directory + key;
}

/// Base node of a particle in its block's arena, 0..5, and its distance from it in cells.
struct ReachPlace {
  Vec<int, 3> base;
  Vec<float, 3> fx;
  bool inside;  ///< false: the particle has left the arena (base is then clamped)
};
GRAUPEL_HD inline ReachPlace reach_place(const GridGeometry<float, 3>& grid, const Vec<int, 3>& block,
                                         const Vec<float, 3>& x) {
  ReachPlace place;
  place.inside = true;
  const Vec<float, 3> local = grid.local(x);
  const Vec<int, 3> base = base_node(local);
  for (int d = 0; d < 3; ++d) {
    int c = base[d] - block_width * block[d] + 1;
    if (c < 0 || c > 5) {
      place.inside = false;
      c = c < 0 ? 0 : 5;
    }
    place.base[d] = c;
    place.fx[d] = local[d] - static_cast<float>(block_width * block[d] + c - 1);
  }
  return place;
}

}  // namespace graupel::mpm::batch
