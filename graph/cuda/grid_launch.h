// A grid in one launch on a GPU: the steps of graph/grid_builder.cpp by all multiprocessors, which wait for each other
// three times. Pairs are counted where their cell's bit lies, so that their lists begin with the numbers of the cells.
#pragma once

#include "graph/grid_kernels.h"

namespace graupel::graph {

struct GridProgram {
  int64_t particles, words, fine_words;  ///< words of all levels; of level 0, which come first
  const Vec3f* position;
  float *weight, *offset;
  /// Zero between launches, as are the words: pairs by bit of level 0 [32 fine_words], by word [fine_words]; whether a
  /// particle was outside.
  int32_t *bit_pairs, *word_pairs, *outside;
  int32_t* rank;           ///< [words]
  grid::LinkCell link;     ///< its counts are made last
  int32_t *cell, *place;   ///< [pairs]
  int32_t* pair_begin;     ///< [cells of level 0 + 1]
  int32_t *listed, *pair;  ///< [pairs]
  int32_t* overflow;
};

/// Whether this GPU can, and whether it should: grids of many scenes are made beside other work, which leaves no room
/// for blocks that wait for each other.
bool builds_grid_at_once(int scenes, int64_t words);
void build_grid(const GridProgram& program, void* stream);

}  // namespace graupel::graph
