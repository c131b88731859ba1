// Work on rows of latents in tiles that stay in a core's cache. Rows are padded (nn/linear.h).
#pragma once

#include <algorithm>
#include <vector>

#include "core/parallel/buffer.h"
#include "core/parallel/parallel_for.h"

namespace graupel::graph {

/// Rows that a thread works on at once: with 128 columns its buffers stay in the second-level cache.
inline constexpr int32_t tile_rows = 192;

/// What one thread needs for one tile; each [tile_rows][H], `input` wide enough for features, too.
struct TileScratch {
  Buffer<float> input, hidden, output, sums;
};

/// One scratch a thread, for rows of `width` columns and of `features` numbers.
inline void prepare_scratch(std::vector<TileScratch>& scratch, int width, int features) {
  scratch.resize(static_cast<std::size_t>(num_threads()));
  const auto tile = static_cast<std::size_t>(tile_rows), w = static_cast<std::size_t>(width);
  for (TileScratch& thread : scratch) {
    for (Buffer<float>* buffer : {&thread.hidden, &thread.output, &thread.sums}) buffer->resize_discard(tile * w);
    thread.input.resize_discard(tile * std::max(w, static_cast<std::size_t>(features)));
  }
}

/// body(begin, end, scratch) for each of the tiles, in parallel; tiles are independent.
template <typename Workspace, typename Body>
void for_each_tile(Workspace& workspace, const std::vector<int32_t>& tile, const Body& body) {
  parallel_for(
      Device::cpu, static_cast<int64_t>(tile.size()) - 1,
      [&](int64_t t) {
        body(tile[static_cast<std::size_t>(t)], tile[static_cast<std::size_t>(t) + 1],
             workspace.scratch[static_cast<std::size_t>(thread_slot())]);
      },
      Grain{1});
}

/// The same for ranges of `rows` items out of [0, n).
template <typename Workspace, typename Body>
void for_each_range(Workspace& workspace, int64_t n, int64_t rows, const Body& body) {
  parallel_for(
      Device::cpu, (n + rows - 1) / rows,
      [&](int64_t t) {
        body(static_cast<int32_t>(t * rows), static_cast<int32_t>(t * rows + rows < n ? t * rows + rows : n),
             workspace.scratch[static_cast<std::size_t>(thread_slot())]);
      },
      Grain{1});
}

}  // namespace graupel::graph
