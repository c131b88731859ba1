// The cells that hold matter, numbered by the blocks of a launch (density_solver.h).
#pragma once

#include <cstdint>
#include <cub/block/block_scan.cuh>

#include "graph/corrections/density_solver.h"

namespace graupel::graph::density {

/// Writes rank and cell of a system, block `block` of `blocks` those of its own words. What lies before them each block
/// adds up by itself, so that none waits for another. All threads of the block.
template <int block_threads>
__device__ void list_cells(const DensitySystem& s, typename cub::BlockScan<int32_t, block_threads>::TempStorage& memory,
                           int64_t block, int64_t blocks) {
  using Scan = cub::BlockScan<int32_t, block_threads>;
  const int64_t in_color = s.cells.words_of_color(), words = 2 * in_color, each = (words + blocks - 1) / blocks;
  const int64_t first = min(block * each, words), end = min(first + each, words);
  int32_t count = 0, own = 0, before = 0;
#pragma unroll 4
  for (int64_t w = threadIdx.x; w < first; w += block_threads) count += grid::ones(__ldcg(s.words + w));
  Scan(memory).ExclusiveSum(count, own, before);
  for (int64_t round = first; round < end; round += block_threads) {
    const int64_t w = round + threadIdx.x;
    const uint32_t word = w < end ? __ldcg(s.words + w) : 0;
    int32_t total = 0;
    __syncthreads();
    Scan(memory).ExclusiveSum(grid::ones(word), own, total);
    if (w < end) {
      const int color = w >= in_color;
      int32_t number = before + own;
      s.rank[w] = number;
      for (uint32_t left = word; left != 0; left &= left - 1)
        s.cell[number++] = s.cells.cell_of_bit(color, (w - color * in_color) * word_bits + lowest_one(left));
      if (w + 1 == words) s.rank[words] = number;
    }
    before += total;
  }
}

}  // namespace graupel::graph::density
