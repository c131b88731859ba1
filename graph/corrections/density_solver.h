// The pressure of a density projection on a GPU in one launch (graph/corrections/density_kernels.h): a cluster of
// blocks lists the cells that hold matter and sweeps over them; a few thousand cells are swept by one block in its
// shared memory, very many by all multiprocessors.
#pragma once

#include <vector>

#include "graph/corrections/density_kernels.h"

namespace graupel::graph {

struct DensitySystem {
  density::Cells cells;
  int sweeps;
  float relaxation;
  const density::OpenFractions* open_fractions;
  uint32_t *words, *mass;       ///< of Spread; zero afterwards
  int32_t* rank;                ///< [words + 1], of the last solution before it
  int64_t capacity;             ///< most cells that hold matter
  int32_t* cell;                ///< [capacity] active cells, of the last solution before it
  density::Equation* equation;  ///< [capacity]
  float* pressure;
  const int32_t* skip;  ///< where it is not 0 nothing is done; null: none
  GRAUPEL_HD bool is_skipped() const { return skip != nullptr && *skip != 0; }
};

/// Whether this GPU can for so many words of bits, and at most `capacity` cells that hold matter.
bool solves_density_at_once(int64_t capacity, int64_t words);
/// DropPressure, ListCells and all sweeps, of several scenes at once.
void solve_density(const std::vector<DensitySystem>& systems, void* stream);

/// The same of one by all multiprocessors (density_sweeps.cu).
void sweep_density(const DensitySystem& system, void* stream);

}  // namespace graupel::graph
