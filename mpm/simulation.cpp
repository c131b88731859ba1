#include "mpm/simulation.h"

#include <cmath>

#include "core/error.h"
#include "mpm/scene_check.h"
#include "mpm/solver.h"

namespace graupel::mpm {

namespace {

template <typename T>
Estimate estimate_with(const Scene& scene, const SimulationOptions& options, const SampledParticles& particles,
                       const sparsegrid::ObstacleSet& obstacles) {
  Solver<T> solver(scene, options, particles, obstacles);
  Estimate e;
  e.particles = static_cast<int64_t>(particles.position.size());
  solver.sort_particles();
  e.grid_nodes = int64_t(solver.view().blocks.node_count) * nodes_per_block<3>;
  const double step = largest_step(scene.time_step, scene.domain.dx, scene.frame_time, solver.speeds());
  e.substeps = scene.frames * static_cast<int64_t>(std::ceil(scene.frame_time / step - 1e-9));
  e.memory_bytes = solver.memory_bytes();
  return e;
}

SampledParticles checked_particles(const Scene& scene, const SimulationOptions& options,
                                   const sparsegrid::ObstacleSet& obstacles) {
  if (options.precision == Precision::f64 && options.device != Device::cpu)
    throw ConfigError("double precision runs on the CPU only. Use --device cpu or single precision");
  for (const auto& [name, material] : scene.materials) check_material(material);
  SampledParticles particles = sample_sources(scene, options.seed);
  check_start(scene, particles, obstacles);
  return particles;
}

}  // namespace

std::unique_ptr<Simulation> Simulation::create(const Scene& scene, const SimulationOptions& options) {
  const sparsegrid::ObstacleSet obstacles(scene);
  const SampledParticles particles = checked_particles(scene, options, obstacles);
  if (options.precision == Precision::f64)
    return std::make_unique<Solver<double>>(scene, options, particles, obstacles);
  return std::make_unique<Solver<float>>(scene, options, particles, obstacles);
}

Estimate estimate(const Scene& scene, const SimulationOptions& options) {
  const sparsegrid::ObstacleSet obstacles(scene);
  const SampledParticles particles = checked_particles(scene, options, obstacles);
  if (options.precision == Precision::f64) return estimate_with<double>(scene, options, particles, obstacles);
  return estimate_with<float>(scene, options, particles, obstacles);
}

}  // namespace graupel::mpm
