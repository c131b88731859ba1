// A grid in one launch on a GPU (graph/topology/grid_at_once.h), by all multiprocessors.
#pragma once

#include "graph/topology/grid_at_once.h"

namespace graupel::graph {

/// Whether this GPU can, and whether it should: grids of many scenes are made beside other work, which leaves no room
/// for blocks that wait for each other.
bool builds_grid_at_once(int scenes, int64_t words);
void build_grid(const GridProgram& program, void* stream);

}  // namespace graupel::graph
