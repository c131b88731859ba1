// Many scenes in one launch, for GPUs: what their kernels read and write. Blocks of all scenes stand in one list; the
// scene is part of a block's key (scene * directory + directory index).
//
// Particles lie sorted by block and cell, but the sort is done only now and then: until the next one a particle still
// belongs to the block it was sorted into. A block's arena therefore covers base nodes -1..4 along each axis, one cell
// more than the block on each side, and with the stencil 8 nodes. A scene with a particle beyond that waits for the
// next sort. Everything is summed in an order that depends on the scene's own particles alone, without atomics on
// floating-point numbers: the result is the same in every run, alone or among other scenes.
#pragma once

#include "core/scene/scene.h"
#include "mpm/grid/scene_view.h"
#include "mpm/particles/particles.h"

namespace graupel::mpm {

/// Momentum or velocity x, y, z, and mass: one 16-byte word.
struct alignas(16) NodeSum {
  float v[4];
};

inline constexpr int halo_width = 8;  ///< nodes of a block's arena along an axis
inline constexpr int halo_nodes = halo_width * halo_width * halo_width;

/// Place of node (x, y, z), each 0..7, in an arena. Rows are turned by three nodes, so that the 27 nodes of a stencil
/// lie in different banks of shared memory.
GRAUPEL_HD inline int halo_index(int x, int y, int z) {
  return (x * halo_width + y) * halo_width + ((z + 3 * y) & (halo_width - 1));
}

struct BatchScene {
  SceneView<float> view;
  TimeStep time_step;
  double frame_time;       ///< [s]
  double diffusivity;      ///< largest kinematic viscosity [m^2/s]
  double fall_speed;       ///< that gravity adds in a frame [m/s]
  int32_t first_particle;  ///< its first place in the order of the sources of all scenes
};

enum class ScenePhase : int32_t {
  running,
  unsorted,    ///< waits for the next sort
  frame_done,  ///< waits for the next frame
  diverged,
  too_stiff  ///< the stable step is below a millionth of a frame
};

/// What the particles of a scene report during a substep; taken and cleared by its last block.
struct StepReport {
  uint32_t speed2, sound_speed;                ///< largest, as the bits of non-negative floats (ordered as integers)
  uint32_t before_speed2, before_sound_speed;  ///< of the substep before, in a report of several
  uint32_t peak_sound_speed;                   ///< of all substeps but the last
  int32_t left_halo;                           ///< particles beyond their block's arena
  int32_t over_courant;
  int32_t bad_particle;  ///< lowest place in the order of the sources; no_bad_particle for none
  int32_t blocks_done;   ///< blocks that have reported
  unsigned long long pushed_out;
  unsigned long long pushed_momentum[3];  ///< fixed point, so that the order does not matter
  unsigned long long scripted_momentum[3];
};
inline constexpr int32_t no_bad_particle = 0x7fffffff;
inline constexpr double momentum_unit = 1e-12;  ///< [kg m/s] of sums of momentum

/// The course of one scene.
struct SceneProgress {
  ScenePhase phase;
  float dt;                           ///< of the present substep [s]
  double elapsed;                     ///< inside the frame [s]
  int32_t frame_substeps;             ///< done in this frame
  int32_t equal_substeps;             ///< of this frame, where they are equal
  int32_t blocks;                     ///< owner blocks since the last sort
  int32_t since_sort, sort_interval;  ///< substeps; a scene's own, so that it does not depend on the batch
  double speed, sound_speed;          ///< largest of the present state [m/s]
  double before_speed, before_sound;  ///< of the state before
  int64_t substeps, over_courant, pushed_out;
  double sound_courant;
  int64_t pushed_momentum[3];    ///< units of momentum_unit
  int64_t scripted_momentum[3];  ///< that scripts gave, in the same
  int32_t bad_particle;
};

/// A block of the grid with the particles that were sorted into it; as wide as two loads.
struct alignas(16) OwnerBlock {
  int32_t key;  ///< directory index in its scene
  int32_t scene;
  Vec<int, 3> at;      ///< block coordinates
  int32_t begin, end;  ///< its slots
};

/// Numbers of blocks, on the device.
struct BlockCounts {
  int32_t owner, node;
  int32_t overflow;  ///< set when they exceed the storage: nothing runs until it has grown
  int32_t current;   ///< 0 or 1: the particle arrays in use

  /// Blocks that substeps work on: none while their lists are not complete.
  GRAUPEL_HD int32_t owners_to_run() const { return overflow ? 0 : owner; }
  GRAUPEL_HD int32_t nodes_to_run() const { return overflow ? 0 : node; }
};

/// Everything that the kernels of a batch read or write.
struct BatchView {
  int32_t scene_count, directory, particle_count;
  int32_t owner_capacity, node_capacity;
  const BatchScene* scenes;
  SceneProgress* controls;
  StepReport* reports;
  ParticleView<float> particles[2];
  BlockCounts* counts;
  OwnerBlock* owners;     ///< [owner_capacity] with ascending keys
  int32_t* start;         ///< [n + 1] first slot of each owner block
  int32_t* owner_of_key;  ///< [scenes * directory] -1 for none
  int32_t* node_key;      ///< [node blocks] ascending
  int32_t* node_of_key;   ///< [scenes * directory] -1 for none
  uint8_t* node_flag;     ///< [scenes * directory]
  uint32_t* arrivals;     ///< [scenes] blocks at the barriers of the present segment (mpm/gpu/blocks/batch_resident.h)
  uint32_t* sort_key;     ///< [n] key * 64 + cell, of the sorted slots
  NodeSum* arenas;        ///< [owner_capacity, halo_nodes]
  NodeSum* nodes;         ///< [node_capacity, 64]

  GRAUPEL_HD const ParticleView<float>& current_particles() const { return particles[counts->current]; }
};

}  // namespace graupel::mpm
