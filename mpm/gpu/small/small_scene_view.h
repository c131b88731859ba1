// Small scenes with equal steps on a GPU: what their kernel (mpm/gpu/small/small_scene_step.h) reads and writes.
//
// A small scene keeps its whole grid in full, three times: one grid holds the sums that particles read in a substep,
// one takes the sums of the next, and one is cleared for the one after. Sums are integers, multiples of a unit of
// momentum or mass: they do not depend on the order of the particles, so that no particle is ever sorted, and every
// run gives the same bytes, alone or among other scenes.
#pragma once

#include "mpm/gpu/blocks/batch_view.h"
#include "mpm/grid/moving_obstacles.h"
#include "mpm/particles/particle_lifecycle.h"
#include "mpm/physics/transfer.h"

namespace graupel::mpm {

/// Two of a node's four sums: momentum x and y, or momentum z and mass, in units.
struct alignas(16) UnitPair {
  long long a, b;
};

/// What holds the material at a node.
struct alignas(16) NodeContact {
  Vec<float, 3> normal;
  int32_t code;  ///< law + 1 (0: none) in the low 16 bits; above, bit 2 axis + side: a further wall that holds it;
                 ///< held_by_moving
};
inline constexpr int32_t held_by_moving = 1
                                          << 22;  ///< the law is that of a moving obstacle; normal zero deep inside it

/// A contact law: first those of the obstacles, then of the walls (2 axis + side), last that of obstacles deep inside,
/// where no normal is known and the material stands still.
struct ContactLaw {
  Contact contact;
  float friction;
};
inline constexpr int laws_of_walls = 6;

/// What a scene has beside its BatchScene.
struct SmallScene {
  int32_t first, count;                    ///< slots
  Vec<int, 3> nodes;                       ///< along each axis, the last one fastest
  float momentum_unit, per_momentum_unit;  ///< [kg m/s] and its inverse, powers of two
  float mass_unit, per_mass_unit;          ///< [kg]
  UnitPair* sums[3];                       ///< [nodes, 2] each
  const NodeContact* contact;              ///< [nodes]
  int32_t first_wall_law;
  const ContactLaw* laws;  ///< [obstacles + 7]
};

/// The nodes that a moving obstacle may hold in a substep: a box of the grid, and its first place in the scene's table.
struct NodeBox {
  Vec<int, 3> low, size;
  int32_t first;

  GRAUPEL_HD int32_t count() const { return size[0] * size[1] * size[2]; }
};

/// What changes in a scene during a frame, known before it.
struct ChangingScene {
  int32_t substeps;
  int32_t script_count;
  MovingObstacleView<float> moving;  ///< in the first substep
  const NodeBox* boxes;              ///< [substeps, moving.count]
  NodeContact* contact[2];           ///< [nodes of the boxes] each, for even and odd substeps
  LifecycleView<float> lifecycle;
  const double* step_end;            ///< [substeps] [s]; where particles come and go
  const ScriptStep<float>* scripts;  ///< [substeps, script_count]
  CarriedAffine<float> carried;
};

/// Blocks of threads stand in groups; a group takes one scene after the other.
struct SmallBatchView {
  static constexpr bool changes = false;

  int32_t scene_count, groups;
  const BatchScene* scenes;
  const SmallScene* small;
  SceneProgress* controls;
  StepReport* reports;
  ParticleView<float> particles;
  int32_t* base;       ///< [3, n] lowest node of the stencil that a particle last added to each grid, or -1
  uint32_t* arrivals;  ///< [scenes] blocks at the barriers of the present frame
};

/// Scenes with moving obstacles, with particles that come and go or that scripts lead, or with other transfers than
/// APIC. The others have a kernel without them.
struct ChangingBatchView : SmallBatchView {
  static constexpr bool changes = true;

  const ChangingScene* changing;  ///< [scenes]
};

}  // namespace graupel::mpm
