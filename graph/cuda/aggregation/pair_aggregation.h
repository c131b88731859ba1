// The sums that cells gather from the pairs of particles and corners (particle to grid,
// graph/cuda/persistent/persistent_layers.h): of a cell with hundreds of pairs many half warps add up a part each.
#pragma once

#include <cstdint>
#include <vector>

#include "core/parallel/host_device.h"
#include "graph/topology/range_search.h"

namespace graupel::graph {

/// Most pairs of a part of the list.
inline constexpr int pairs_a_part = 32;

/// The parts of the list of pairs: 32 pairs each, counted from the first pair of a scene. So the sums of a scene do not
/// depend on the scenes before it.
struct PairParts {
  int32_t scenes;
  const int32_t* pair_begin;  ///< [scenes + 1] the scenes' places in the list; null: it is one scene's
  const int32_t* part_begin;  ///< [scenes + 1] their first parts

  /// The part of a pair of the list.
  GRAUPEL_HD int32_t part_of(int32_t pair) const {
    if (pair_begin == nullptr) return pair / pairs_a_part;
    const int scene = grid::range_of(pair_begin, scenes, pair);
    return part_begin[scene] + (pair - pair_begin[scene]) / pairs_a_part;
  }
  struct Range {
    int32_t begin, end;
  };
  /// The pairs of a part; none beyond the last part.
  GRAUPEL_HD Range pairs_of(int32_t part) const {
    if (pair_begin == nullptr) return {part * pairs_a_part, (part + 1) * pairs_a_part};
    if (part >= part_begin[scenes]) return {0, 0};
    const int scene = grid::range_of(part_begin, scenes, part);
    const int32_t begin = pair_begin[scene] + (part - part_begin[scene]) * pairs_a_part, end = pair_begin[scene + 1];
    return {begin, begin + pairs_a_part < end ? begin + pairs_a_part : end};
  }
};

/// [2 (scenes + 1)] pair_begin and part_begin of scenes with so many pairs each.
inline std::vector<int32_t> begins_of_parts(const std::vector<int64_t>& pairs_of_scene) {
  std::vector<int32_t> pair_begin = {0}, part_begin = {0};
  for (const int64_t pairs : pairs_of_scene) {
    pair_begin.push_back(pair_begin.back() + static_cast<int32_t>(pairs));
    part_begin.push_back(part_begin.back() + static_cast<int32_t>((pairs + pairs_a_part - 1) / pairs_a_part));
  }
  pair_begin.insert(pair_begin.end(), part_begin.begin(), part_begin.end());
  return pair_begin;
}

/// For each part p of the list of pairs (PairParts) and each cell c with pairs in it
///   sums[c + p] = sum over these pairs i of weight[i] a(source[i / 8] + table[i % 8]),   a = LeakyReLU 0.01.
/// Cells and parts both ascend along the list, so that no two have the same row, and the rows of a cell are neighbours.
/// All pointers are to the GPU's memory.
struct PairAggregation {
  const int32_t* range;     ///< cells range[0] to range[1] - 1 of `begin`; they are cells 0, 1, .. of all others
  int32_t most_cells;       ///< with more than that nothing is done
  const int32_t* overflow;  ///< where it is not 0 nothing is done; null: none
  const int32_t* begin;     ///< the cells' places in `pair`
  const int32_t* pair;      ///< by cell
  const int32_t* cell;      ///< of each pair
  const float* weight;      ///< of each pair
  const uint16_t* source;   ///< [particles, 128], bf16
  const float* table;       ///< [8, 128]
  float* sums;              ///< [rows_of_pair_aggregation(cells, pairs, scenes), 128]
  PairParts parts;
};
inline int64_t rows_of_pair_aggregation(int64_t cells, int64_t pairs, int64_t scenes = 1) {
  return cells + pairs / pairs_a_part + scenes;
}

/// `pairs`: as many as there are at most.
void aggregate_pairs(const PairAggregation& sums, int64_t pairs, void* stream);

}  // namespace graupel::graph
