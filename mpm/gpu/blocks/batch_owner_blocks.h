// The blocks of a batch as kernels see them: which scene and place a owner block has, its neighbours, and where its
// particles lie in its arena.
#pragma once

#include "mpm/gpu/blocks/batch_view.h"
#include "mpm/physics/stencil.h"

namespace graupel::mpm::batch {

/// The block with a key of the batch, without particles.
GRAUPEL_HD inline OwnerBlock block_of_key(const BatchView& view, int32_t full_key) {
  OwnerBlock b{};
  b.scene = full_key / view.directory;
  b.key = full_key - b.scene * view.directory;
  b.at = view.scenes[b.scene].view.grid.block_of(b.key);
  return b;
}

/// Directory index of the block at `at` + (x, y, z) in its scene, or -1 outside the directory.
GRAUPEL_HD inline int32_t neighbor_in_scene(const BatchView& view, const OwnerBlock& b, int x, int y, int z) {
  const GridGeometry<float, 3>& grid = view.scenes[b.scene].view.grid;
  const Vec<int, 3> at = {b.at[0] + x, b.at[1] + y, b.at[2] + z};
  for (int d = 0; d < 3; ++d)
    if (at[d] < 0 || at[d] >= grid.blocks[d]) return -1;
  return grid.directory_index(at);
}

/// The same as a key of the batch.
GRAUPEL_HD inline int32_t neighbor_key(const BatchView& view, const OwnerBlock& b, int x, int y, int z) {
  const int32_t key = neighbor_in_scene(view, b, x, y, z);
  return key < 0 ? -1 : b.scene * view.directory + key;
}

/// The lowest node of a block's arena, and the last base node in it, counted from there.
GRAUPEL_HD inline Vec<int, 3> halo_low(const Vec<int, 3>& block) {
  return block_width * block - Vec<int, 3>::filled(1);
}
inline constexpr int halo_last_base = halo_width - stencil_width<>;

/// Stencil of a particle in its block's arena.
GRAUPEL_HD inline Stencil<float, 3> halo_stencil(const GridGeometry<float, 3>& grid, const Vec<int, 3>& block,
                                                 const Vec<float, 3>& x) {
  return stencil_at(grid.local(x), halo_low(block), halo_last_base);
}
/// Whether it lies there.
GRAUPEL_HD inline bool is_in_halo(const GridGeometry<float, 3>& grid, const Vec<int, 3>& block,
                                  const Vec<float, 3>& x) {
  const Vec<int, 3> base = base_node(grid.local(x)) - halo_low(block);
  bool inside = true;
  for (int d = 0; d < 3; ++d) inside = inside && base[d] >= 0 && base[d] <= halo_last_base;
  return inside;
}

}  // namespace graupel::mpm::batch
