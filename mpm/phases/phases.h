// The phases of one substep. Each is one or two kernels over views; together they are the algorithm of
// Solver::substep (docs/reference/method.md).
#pragma once

#include "core/scene/load.h"
#include "mpm/grid/block_table.h"
#include "mpm/grid/moving_obstacles.h"
#include "mpm/grid/scene_view.h"
#include "mpm/particles/particle_lifecycle.h"
#include "mpm/particles/particles.h"
#include "mpm/physics/step_report.h"

namespace graupel::mpm {

/// Everything that kernels read or write.
template <typename T>
struct SolverView : SceneView<T> {
  Device device;
  ParticleView<T> particles;
  BlockView blocks;
  MovingObstacleView<T> moving;
  LifecycleView<T> lifecycle;
  int dimensions;  ///< 2 or 3
  Spline spline;
  T* arenas;      ///< [owner blocks, arena_size]: sums of each block's own particles (CPU)
  T* nodes;       ///< [node blocks, 16 or 64, 4]: momentum, then velocity; mass
  int32_t* keys;  ///< [n] owner block of each slot, or no_owner
  uint8_t* keys_changed;
  bool some_stationary;  ///< whether any material is stationary

  /// Whether a particle keeps its place and velocity whatever the grid does.
  GRAUPEL_HD bool is_stationary(int64_t slot) const {
    return some_stationary && this->materials[particles.material.get(slot)].model == MaterialModel::stationary;
  }
};

/// Momentum given to particles [kg m/s].
struct Impulse {
  double momentum[3] = {0, 0, 0};
  GRAUPEL_HD void merge(const Impulse& o) {
    for (int d = 0; d < 3; ++d) momentum[d] += o.momentum[d];
  }
};

/// Particles that a script leads take its velocity and gradient; returns the momentum that this gave them [kg m/s].
template <typename T>
Vec3d move_kinematic_particles(const SolverView<T>& view, Buffer<Impulse>& records);

/// The particles that carry a load.
struct CarrierSum {
  double mass = 0;  ///< [kg]
  int64_t particles = 0;
  GRAUPEL_HD void merge(const CarrierSum& o) {
    mass += o.mass;
    particles += o.particles;
  }
};

/// What is in a load's ball now and can move: in the run, not stationary, led by no script. `carries` [n], by the
/// particles' place in the order of the sources, becomes 1 for them; null: they are only counted.
template <typename T>
CarrierSum choose_carriers(const SolverView<T>& view, const Load& load, uint8_t* carries, Buffer<CarrierSum>& records);
/// v <- v + gain [m/s] of the carriers that are in the run; returns the momentum that this gave them [kg m/s].
template <typename T>
Vec3d push_carriers(const SolverView<T>& view, const uint8_t* carries, const Vec<T, 3>& gain, Buffer<Impulse>& records);

/// Node sums with those of all periodic images, into an array like view.nodes.
template <typename T>
void join_periodic(const SolverView<T>& view, T* joined);

/// C <- symmetric sym(C) + rotation skew(C).
template <typename T>
void blend_affine(const SolverView<T>& view, T symmetric, T rotation);

/// Node momentum and mass from all particles: MLS-MPM force and APIC momentum.
template <typename T>
void particle_to_grid(const SolverView<T>& view, T dt);
/// The same where every node looks for its particles: the form for GPUs.
template <typename T>
void particle_to_grid_by_nodes(const SolverView<T>& view, T dt);

/// Momentum -> velocity, gravity, obstacles, walls.
template <typename T>
void update_grid(const SolverView<T>& view, T dt);

/// The same of one node block, on the CPU.
template <typename T>
void update_grid_block(const SolverView<T>& view, T dt, int64_t block);
/// Whether a moving obstacle may hold nodes of the block with this key.
template <typename T>
bool touches_moving_obstacle(const SolverView<T>& view, int32_t key);

/// Particle velocity and affine velocity from the nodes.
template <typename T>
void grid_to_particle(const SolverView<T>& view);
/// The same where every particle reads its own nodes: the form for GPUs.
template <typename T>
void grid_to_particle_by_particles(const SolverView<T>& view);

/// The same of the slots 0..count - 1, on the CPU.
template <typename T>
void grid_to_particle_slots(const SolverView<T>& view, int64_t count);

/// F <- (I + dt C) F, return mapping, stress.
template <typename T>
void update_deformation(const SolverView<T>& view, T dt);
/// The same, one particle at a time on any device; and 16 at a time on the CPU.
template <typename T>
void update_deformation_portable(const SolverView<T>& view, T dt);
template <typename T>
void update_deformation_tiles(const SolverView<T>& view, T dt);

/// The same of the slots first..end - 1, at most a tile of them, on the CPU.
template <typename T>
void update_deformation_slots(const SolverView<T>& view, T dt, int64_t first, int64_t end);

/// x <- x + dt v, kept out of obstacles and inside the walls; particles that are born, leave or pass a periodic wall;
/// new owner blocks; the step_statistics of the new state.
template <typename T>
StepStatistics move_particles(const SolverView<T>& view, T dt, Buffer<StepStatistics>& records);

/// True for static obstacles, closed walls and a fixed set of particles without scripts.
template <typename T>
bool moves_plainly(const SolverView<T>& view);
/// move_particles(), and the step_statistics alone, of some slots of a scene that moves plainly, on the CPU.
template <typename T>
void move_slots(const SolverView<T>& view, T dt, int64_t first, int64_t end, StepStatistics& found);
template <typename T>
void statistics_slots(const SolverView<T>& view, T dt, int64_t first, int64_t end, StepStatistics& found);

/// The step_statistics alone, for a state that was just made or loaded.
template <typename T>
StepStatistics particle_statistics(const SolverView<T>& view, Buffer<StepStatistics>& records);

/// Home block of every slot from its position.
template <typename T>
void find_owner_blocks(const SolverView<T>& view);

/// Copies every particle from slot order[i] of `from` to slot i of `to`.
template <typename T>
void permute_particles(Particles<T>& from, Particles<T>& to, const int32_t* order);

}  // namespace graupel::mpm
