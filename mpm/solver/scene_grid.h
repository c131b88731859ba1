// The grid of one scene with all that acts on it (walls, obstacles, scripts)
// and the first half of a substep, from particles to node velocities. The
// solver runs it with its particles, a reduced-order model with its integration
// points.
#pragma once

#include <vector>

#include "core/parallel/instruction_set.h"
#include "core/scene/gravity.h"
#include "mpm/phases/phases.h"
#include "mpm/sampling.h"
#include "mpm/simulation.h"
#include "mpm/solver/contact_recorder.h"

namespace graupel::mpm {

template <typename T>
struct SceneGrid {
  /// With node velocities for `particles` of them at most; `sampled` tells
  /// materials and scripts.
  SceneGrid(const SimulationOptions& options, const Scene& scene, const SampledParticles& sampled,
            const sparsegrid::ObstacleSet& obstacles, int64_t particles);

  /// Room for so many particles, without blocks.
  void resize(int64_t particles);
  /// For kernels; blocks and grid storage are those of the last sort().
  SolverView<T> view(const ParticleView<T>& particles);
  /// Blocks in use and the particles of each; grid storage to match.
  void sort(const ParticleView<T>& particles);
  /// Scripted motion, P2G, images of periodic nodes and the grid update of the
  /// substep of `dt` from `time` on [s]. `scripted` takes the momentum that
  /// scripts give to particles [kg m/s].
  SolverView<T> move_nodes(const ParticleView<T>& particles, double time, double dt, Vec3d& scripted);
  /// Particles that a script leads take its velocity and gradient.
  void lead(const SolverView<T>& view, Vec3d& scripted);
  int64_t bytes() const;

  Device device;
  bool tuned;  ///< by the vectorised kernels
  InstructionSet instruction_set;
  GridGeometry<T, 3> geometry;
  WallView<T> walls;
  Vec<T, 3> gravity;  ///< of the present substep: its mean
  bool push_out, periodic, some_stationary = false;
  int dimensions;
  Spline spline;
  std::vector<MaterialConfig> material_configs;
  Buffer<MaterialParameters<T>> materials;
  MovingObstacles<T> moving;
  ParticleLifecycle<T> lifecycle;
  ObstacleNodes<T> obstacle_nodes;
  BlockTable blocks;
  Buffer<StepStatistics> records;
  ContactRecorder<T>* contacts = nullptr;  ///< is told of every grid update; null: nobody asks

 private:
  Vec3d first_gravity_;  ///< at time 0
  std::vector<GravityKey> gravity_keyframes_;
  Buffer<T> arenas_, nodes_;
  Buffer<T> joined_;  ///< node sums with those of periodic images
  Buffer<Impulse> impulses_;
};

extern template struct SceneGrid<float>;
extern template struct SceneGrid<double>;

}  // namespace graupel::mpm
