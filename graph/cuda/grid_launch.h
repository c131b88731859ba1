// A small grid in one launch on a GPU: the steps of graph/grid_builder.cpp one after the other by a cluster of blocks.
#pragma once

#include "graph/grid_kernels.h"

namespace graupel::graph {

struct GridProgram {
  int32_t* cleared;  ///< [cleared_size] to be zero at first
  int64_t cleared_size, particles, words;
  grid::Locate locate;
  int32_t* rank;  ///< [words + 1]
  grid::LinkCell link;
  grid::FindPairs find;
  int32_t* pair_begin;
  grid::ListPairs list;
  grid::OrderPairs order;
};

/// Whether this GPU can, and whether it is faster for so many particles and words.
bool builds_grid_at_once(int64_t particles, int64_t words);
void build_grid(const GridProgram& program, void* stream);

}  // namespace graupel::graph
