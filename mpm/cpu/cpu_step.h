// The substep's hot loops on the CPU as tables of functions, one table for each instruction set, over plain views: what
// crosses the border between code for this processor and code for any (mpm/cpu/kernels.cpp).
#pragma once

#include <cstdint>

#include "mpm/materials/material_parameters.h"
#include "mpm/physics/step_report.h"

namespace graupel {
enum class InstructionSet;
}

namespace graupel::mpm {

/// Parts of a particle's step that advance() does.
enum class AdvanceParts {
  gather,             ///< velocity and affine velocity from the arenas
  gather_and_deform,  ///< and deformation, return mapping, stress
  all                 ///< and motion, new owner blocks, step_statistics
};

/// Slots whose step_statistics is one record.
inline constexpr int64_t slots_per_record = 512;

/// One substep of a 3-D scene with quadratic splines: arrays as in SolverView (mpm/phases/phases.h).
template <typename T>
struct CpuStep {
  T dt;
  int64_t count;  ///< of particles
  T *position, *velocity, *affine_velocity, *deformation_gradient, *stress, *internal;
  const T* volume;
  const int32_t* material;
  const MaterialParameters<T>* materials;
  bool some_stationary;

  T origin[3], dx, inverse_dx;
  int32_t blocks[3];
  const int32_t *owner_key, *owner_to_node, *node_to_owner, *owner_of_key, *start, *order;
  T *arenas, *nodes;
  int32_t* keys;
  uint8_t* keys_changed;

  T gravity[3], wall_low[3], wall_high[3];
  const int32_t* node_key;
  const int32_t* node_surfaces;  ///< [directory] negative where no obstacle at rest acts on nodes
  bool obstacles_move;           ///< some do

  T particle_low[3], particle_high[3];
  const int32_t* surface_blocks;  ///< node_surfaces, or null where obstacles do not push particles

  /// The general code, for particles that the tables' functions leave to it.
  const void* view;
  void (*deform_slots)(const void* view, T dt, int64_t first, int64_t end);  ///< at most a tile
  void (*update_block)(const void* view, T dt, int64_t node_block);
  bool (*touches_moving_obstacle)(const void* view, int32_t key);
  void (*move_slots)(const void* view, T dt, int64_t first, int64_t end, StepStatistics& found);
  void (*statistics_slots)(const void* view, T dt, int64_t first, int64_t end, StepStatistics& found);
};

/// Each call is one item of a parallel loop.
template <typename T>
struct CpuKernels {
  void (*scatter)(const CpuStep<T>&, int64_t owner);            ///< P2G: the owner block's particles into its arena
  void (*sum_arenas)(const CpuStep<T>&, int64_t node_block);    ///< arenas -> nodes
  void (*update_nodes)(const CpuStep<T>&, int64_t node_block);  ///< momentum -> velocity, gravity, contact
  void (*fill_arena)(const CpuStep<T>&, int64_t owner);         ///< node velocities -> the owner block's arena
  /// G2P from the arenas, and more, of the slots of one record.
  void (*advance)(const CpuStep<T>&, AdvanceParts, int64_t record, StepStatistics& found);
};

template <typename T>
const CpuKernels<T>& cpu_kernels(InstructionSet set);

}  // namespace graupel::mpm
