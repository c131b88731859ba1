// The phases of one substep. Each is one or two kernels over views; together they are the algorithm of
// Solver::substep (docs/method.md).
#pragma once

#include "mpm/block_table.h"
#include "mpm/material_parameters.h"
#include "mpm/obstacle_nodes.h"
#include "mpm/particles.h"

namespace graupel::mpm {

/// What holds the material at the walls.
template <typename T>
struct WallView {
  Vec<T, 3> low, high;                    ///< wall planes; nodes on and behind them are held [m]
  Vec<T, 3> particle_low, particle_high;  ///< no particle leaves this box [m]
  Contact contact;
  T friction;
};

/// Everything that kernels read or write.
template <typename T>
struct SolverView {
  Device device;
  GridGeometry<T, 3> grid;
  WallView<T> walls;
  Vec<T, 3> gravity;  ///< [m/s^2]
  bool push_out;      ///< keep particles out of obstacles
  const MaterialParameters<T>* materials;
  ParticleView<T> particles;
  BlockView blocks;
  ObstacleNodeView<T> obstacle_nodes;
  T* arenas;      ///< [home blocks, arena_size]: sums of each block's own particles (CPU)
  T* nodes;       ///< [node blocks, 64, 4]: momentum, then velocity; mass
  int32_t* keys;  ///< [n] home block of each slot
  uint8_t* keys_changed;
  bool some_stationary;  ///< whether any material is stationary

  /// Whether a particle keeps its place and velocity whatever the grid does.
  GRAUPEL_HD bool is_stationary(int64_t slot) const {
    return some_stationary && materials[particles.material.get(slot)].model == MaterialModel::stationary;
  }
};

/// What a pass over some particles found. Sums are added and bounds are merged in a fixed order.
struct Survey {
  double largest_speed2 = 0;       ///< of finite velocities [m^2/s^2]
  double largest_sound_speed = 0;  ///< [m/s]
  int64_t over_courant = 0;        ///< particles with c dt / dx > 1
  int64_t bad_slot = -1;           ///< lowest slot with NaN, J <= 0 or a move over one cell
  int64_t pushed_out = 0;
  double pushed_momentum[3] = {0, 0, 0};  ///< [kg m/s]

  GRAUPEL_HD void merge(const Survey& o) {
    largest_speed2 = o.largest_speed2 > largest_speed2 ? o.largest_speed2 : largest_speed2;
    largest_sound_speed = o.largest_sound_speed > largest_sound_speed ? o.largest_sound_speed : largest_sound_speed;
    over_courant += o.over_courant;
    if (o.bad_slot >= 0 && (bad_slot < 0 || o.bad_slot < bad_slot)) bad_slot = o.bad_slot;
    pushed_out += o.pushed_out;
    for (int d = 0; d < 3; ++d) pushed_momentum[d] += o.pushed_momentum[d];
  }
};

/// Node momentum and mass from all particles: MLS-MPM force and APIC momentum.
template <typename T>
void particle_to_grid(const SolverView<T>& view, T dt);
/// The same where every node looks for its particles: the form for GPUs.
template <typename T>
void particle_to_grid_by_nodes(const SolverView<T>& view, T dt);

/// Momentum -> velocity, gravity, obstacles, walls.
template <typename T>
void update_grid(const SolverView<T>& view, T dt);

/// Particle velocity and affine velocity from the nodes.
template <typename T>
void grid_to_particle(const SolverView<T>& view);
/// The same where every particle reads its own nodes: the form for GPUs.
template <typename T>
void grid_to_particle_by_particles(const SolverView<T>& view);

/// F <- (I + dt C) F, return mapping, stress.
template <typename T>
void update_deformation(const SolverView<T>& view, T dt);
/// The same, one particle at a time on any device; and 16 at a time on the CPU.
template <typename T>
void update_deformation_portable(const SolverView<T>& view, T dt);
template <typename T>
void update_deformation_tiles(const SolverView<T>& view, T dt);

/// x <- x + dt v, kept out of obstacles and inside the walls; new home blocks; the survey of the new state.
template <typename T>
Survey move_particles(const SolverView<T>& view, T dt, Buffer<Survey>& records);

/// The survey alone, for a state that was just made or loaded.
template <typename T>
Survey survey_particles(const SolverView<T>& view, Buffer<Survey>& records);

/// Home block of every slot from its position.
template <typename T>
void find_home_blocks(const SolverView<T>& view);

/// Copies every particle from slot order[i] of `from` to slot i of `to`.
template <typename T>
void permute_particles(Particles<T>& from, Particles<T>& to, const int32_t* order);

}  // namespace graupel::mpm
