#include "mpm/simulation.h"

#include <cmath>

#include "core/error.h"
#include "mpm/cuda_simulation.h"
#include "mpm/scene_check.h"
#include "mpm/solver.h"

namespace graupel::mpm {

namespace {

#ifdef GRAUPEL_HAVE_CUDA
/// What the tuned kernels for GPUs do not know, "" for nothing; the portable ones know all.
std::string beyond_tuned_kernels(const Scene& scene) {
  for (const Source& source : scene.sources)
    if (source.motion) return "led particles";
  if (scene.domain.is_plane()) return "two dimensions";
  if (scene.transfer.spline != Spline::quadratic) return "cubic splines";
  if (scene.has_moving_obstacles()) return "moving obstacles";
  if (!scene.kinematic_regions.empty()) return "led particles";
  if (!scene.emitters.empty()) return "emitters";
  if (!scene.sinks.empty()) return "sinks";
  if (scene.domain.has_wall(Wall::open)) return "open walls";
  if (scene.domain.has_wall(Wall::periodic)) return "periodic walls";
  if (scene.transfer.scheme != TransferScheme::apic) return "other transfers than apic";
  return scene.transfer.damping == 0 ? "" : "damped transfers";
}
#endif

template <typename T>
Estimate estimate_with(const Scene& scene, const SimulationOptions& options, const SampledParticles& particles,
                       const sparsegrid::ObstacleSet& obstacles) {
  Solver<T> solver(scene, options, particles, obstacles);
  Estimate e;
  e.particles = static_cast<int64_t>(particles.position.size());
  solver.sort_particles();
  const int nodes = scene.domain.is_plane() ? nodes_per_block<2> : nodes_per_block<3>;
  e.grid_nodes = int64_t(solver.view().blocks.node_count) * nodes;
  const double step = largest_step(scene.time_step, scene.domain.dx, scene.frame_time, solver.speeds());
  e.substeps = scene.frames * static_cast<int64_t>(std::ceil(scene.frame_time / step - 1e-9));
  e.memory_bytes = solver.memory_bytes();
  return e;
}

SampledParticles checked_particles(const Scene& scene, const SimulationOptions& options,
                                   const sparsegrid::ObstacleSet& obstacles) {
  if (options.precision == Precision::f64 && options.device != Device::cpu)
    throw ConfigError("double precision runs on the CPU only. Use --device cpu or single precision");
  check_plane(scene);
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
#ifdef GRAUPEL_HAVE_CUDA
  if (options.device == Device::cuda && options.kernels == Kernels::tuned && beyond_tuned_kernels(scene).empty())
    return make_cuda_simulation(scene, options, particles, obstacles);
#endif
  return std::make_unique<Solver<float>>(scene, options, particles, obstacles);
}

std::unique_ptr<SceneBatch> SceneBatch::create([[maybe_unused]] const std::vector<Scene>& scenes,
                                               [[maybe_unused]] const std::vector<uint64_t>& seeds) {
#ifdef GRAUPEL_HAVE_CUDA
  std::vector<SampledParticles> particles;
  std::vector<sparsegrid::ObstacleSet> obstacles;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const std::string unknown = beyond_tuned_kernels(scenes[i]);
    if (!unknown.empty())
      throw ConfigError("scene '" + scenes[i].name + "' has " + unknown +
                        ", which batches on a GPU do not know. Run it alone");
    obstacles.emplace_back(scenes[i]);
    particles.push_back(checked_particles(scenes[i], {.device = Device::cuda, .seed = seeds.at(i)}, obstacles.back()));
  }
  return make_cuda_batch(scenes, particles, obstacles);
#else
  throw ConfigError("this graupel was built without CUDA, which batches of scenes need. Run the scenes one by one");
#endif
}

Estimate estimate(const Scene& scene, const SimulationOptions& options) {
  const sparsegrid::ObstacleSet obstacles(scene);
  const SampledParticles particles = checked_particles(scene, options, obstacles);
  if (options.precision == Precision::f64) return estimate_with<double>(scene, options, particles, obstacles);
  return estimate_with<float>(scene, options, particles, obstacles);
}

ParticleFrame frame_with_fields(const Simulation& simulation, FieldSet wanted) {
  ParticleFrame frame = simulation.frame();
  if (!wanted.empty()) frame.fields = simulation.fields(wanted);
  return frame;
}

}  // namespace graupel::mpm
