// The sums that cells gather from the pairs of particles and corners (particle to grid,
// graph/cuda/persistent/persistent_layers.h): of a cell with hundreds of pairs many half warps add up a part each.
#pragma once

#include <cstdint>

namespace graupel::graph {

/// Pairs of a part of the list.
inline constexpr int pairs_a_part = 32;

/// For each part p of the list of pairs (pairs p 32 to p 32 + 31) and each cell c with pairs in it
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
  float* sums;              ///< [rows_of_pair_aggregation(cells, pairs), 128]
};
inline int64_t rows_of_pair_aggregation(int64_t cells, int64_t pairs) { return cells + pairs / pairs_a_part + 1; }

/// `pairs`: as many as there are at most.
void aggregate_pairs(const PairAggregation& sums, int64_t pairs, void* stream);

}  // namespace graupel::graph
