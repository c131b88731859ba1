// What a run keeps of its scene on a device, whatever solver runs it.
#pragma once

#include "mpm/grid/moving_obstacles.h"
#include "mpm/grid/scene_view.h"
#include "mpm/particles/host_particles.h"
#include "mpm/particles/particle_lifecycle.h"
#include "mpm/physics/step_report.h"

namespace graupel::mpm {

template <typename T>
struct SceneSetup {
  SceneSetup(Scene read_scene, const SampledParticles& particles, const sparsegrid::ObstacleSet& set, Device device);

  SceneView<T> view() const;
  /// Largest speed in the frame from a time [s] on, for the policy of steps that it settles: of particles whose speed
  /// is `speed` at its start, emitted ones, scripts, and what gravity adds [m/s].
  double fastest(double speed, double from) const;

  Scene scene;
  sparsegrid::ObstacleSet obstacles;
  std::vector<MaterialConfig> material_configs;  ///< by the particles' material index
  std::vector<int32_t> particle_type;            ///< [n] in the order of the sources
  double largest_volume = 0;                     ///< of a particle [m^3]
  double diffusivity = 0;                        ///< largest kinematic viscosity [m^2/s]
  GridGeometry<T, 3> grid;
  WallView<T> walls;
  Buffer<MaterialParameters<T>> materials;
  MovingObstacles<T> moving;
  ParticleLifecycle<T> lifecycle;
  ObstacleNodes<T> obstacle_nodes;  ///< of those at rest
};

/// StepStatistics of a state on the host: of the particles that are in the run.
StepStatistics survey_start(const SceneSetup<float>& setup, const HostParticles<float>& particles);

/// Adds the particles of `more` after those of `all`.
void append(HostParticles<float>& all, const HostParticles<float>& more);

}  // namespace graupel::mpm
