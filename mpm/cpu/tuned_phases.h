// The CPU's tuned phases of a substep in three dimensions with quadratic splines, on the instruction set that was
// chosen. Their twins are the phases of mpm/phases/phases.h.
#pragma once

#include "core/parallel/instruction_set.h"
#include "mpm/cpu/cpu_step.h"
#include "mpm/phases/phases.h"

namespace graupel::mpm {

enum class GridParts {
  sums,       ///< node momentum and mass from all particles
  velocities  ///< and the grid update
};
template <typename T>
void particle_to_grid_tuned(const SolverView<T>& view, T dt, InstructionSet set, GridParts parts);

/// The grid update alone, after GridParts::sums.
template <typename T>
void update_grid_tuned(const SolverView<T>& view, T dt, InstructionSet set);

/// G2P, and of deformation and motion what `parts` says; the step_statistics is complete with AdvanceParts::all only,
/// which is for particles that all take part, with nothing that moves but they (moves_plainly()).
template <typename T>
StepStatistics advance_tuned(const SolverView<T>& view, T dt, AdvanceParts parts, Buffer<StepStatistics>& records,
                             InstructionSet set);

}  // namespace graupel::mpm
