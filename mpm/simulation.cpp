#include "mpm/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/scene/checks/range_check.h"
#include "core/scene/scripts.h"
#include "core/system/error.h"
#include "mpm/cpu_batch.h"
#include "mpm/cuda_simulation.h"
#include "mpm/gpu/small/small_scene.h"
#include "mpm/grouped_batch.h"
#include "mpm/memory_need.h"
#include "mpm/scene/scene_check.h"
#include "mpm/solver/solver.h"

namespace graupel::mpm {

namespace {

/// What the tuned kernels for GPUs do not know, "" for nothing; the portable ones know all. Those for small scenes know
/// more.
std::string beyond_tuned_kernels(const Scene& scene, bool small) {
  if (scene.domain.is_plane()) return "two dimensions";
  if (scene.transfer.spline != Spline::quadratic) return "cubic splines";
  if (scene.domain.has_wall(Wall::periodic)) return "periodic walls";
  if (!scene.loads.empty()) return "loads";
  if (scene.has_changing_gravity()) return "gravity that changes";
  if (small) return "";
  if (has_scripts(scene)) return "led particles";
  if (scene.transfer.scheme != TransferScheme::apic) return "other transfers than apic";
  if (scene.transfer.damping != 0) return "damped transfers";
  if (scene.has_moving_obstacles()) return "moving obstacles";
  return scene.has_inactive_particles() ? "emitters, sinks or open walls" : "";
}

bool runs_tuned(const PreparedScene& prepared) {
  return prepared.options.device == Device::cuda && prepared.options.kernels == Kernels::tuned &&
         !prepared.options.contact_forces &&
         beyond_tuned_kernels(prepared.scene, is_small_scene(prepared.scene, prepared.particles.position.size()))
             .empty();
}

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

/// Scenes of one grid that the tuned kernels for GPUs know, grid by grid, and all others, in one group.
SceneGroups groups_of_a_launch(const std::vector<PreparedScene>& scenes) {
  SceneGroups groups;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const auto joins = [&](const std::vector<std::size_t>& group) {
      const PreparedScene &one = scenes[i], &other = scenes[group.front()];
      if (!runs_tuned(one) || !runs_tuned(other)) return runs_tuned(one) == runs_tuned(other);
      return one.scene.domain.dx == other.scene.domain.dx && one.scene.domain.size == other.scene.domain.size;
    };
    const auto found = std::find_if(groups.begin(), groups.end(), joins);
    if (found != groups.end())
      found->push_back(i);
    else
      groups.push_back({i});
  }
  return groups;
}

/// A batch of scenes of one group.
std::unique_ptr<SceneBatch> make_group(const std::vector<PreparedScene>& scenes) {
  if (!runs_tuned(scenes.front())) return make_side_by_side(scenes);
  std::vector<Scene> of_batch;
  std::vector<SampledParticles> particles;
  std::vector<sparsegrid::ObstacleSet> obstacles;
  for (const PreparedScene& s : scenes) {
    of_batch.push_back(s.scene);
    particles.push_back(s.particles);
    obstacles.push_back(s.obstacles);
  }
  check_memory(least_memory(scenes), Device::cuda);
  return make_cuda_batch(of_batch, particles, obstacles);
}

/// The scene, once it is known that the device may run it and that it can fit: before its level sets are made.
const Scene& fitting(const Scene& scene, const SimulationOptions& options) {
  if (options.precision == Precision::f64 && options.device != Device::cpu)
    throw ConfigError("double precision runs on the CPU only. Use --device cpu or single precision");
  check_plane(scene);
  for (const auto& [name, material] : scene.materials) check_material(material);
  check_ranges(scene);
  check_shapes_of_obstacles(scene);
  check_memory(least_memory(scene, options), options.device);
  return scene;
}

/// Where f32 tells places apart to 1/1000 of a cell: |x| 2^-23 of 2^13 cells. Farther away matter loses its height.
void check_single_precision(const Domain& domain, const std::vector<Vec3d>& positions) {
  constexpr double most_cells = 8192;
  for (std::size_t i = 0; i < positions.size(); ++i)
    for (int axis = 0; axis < domain.axes(); ++axis)
      if (std::abs(positions[i][axis]) > most_cells * domain.dx)
        throw ConfigError(fmt::format(
            "particle {} begins at {} = {:.6g} m, {:.6g} cells from 0 (allowed in single precision: {}, where places "
            "are "
            "told apart to 1/1000 of a cell). Move /domain/origin and what is in it nearer to 0, or use double "
            "precision (--precision f64)",
            i, "xyz"[axis], positions[i][axis], std::abs(positions[i][axis]) / domain.dx, most_cells));
}

SampledParticles checked_particles(const Scene& scene, const SimulationOptions& options,
                                   const sparsegrid::ObstacleSet& obstacles) {
  SampledParticles particles = sample_sources(scene, options.seed);
  check_memory(least_memory(scene.domain, options, static_cast<double>(particles.position.size())), options.device);
  if (options.precision == Precision::f32) check_single_precision(scene.domain, particles.position);
  check_start(scene, particles, obstacles);
  return particles;
}

}  // namespace

PreparedScene::PreparedScene(const Scene& read_scene, const SimulationOptions& run_options)
    : scene(read_scene),
      options(run_options),
      obstacles(fitting(scene, options)),
      particles(checked_particles(scene, options, obstacles)) {}

std::unique_ptr<Simulation> Simulation::create(const PreparedScene& prepared) {
  const auto& [scene, options, obstacles, particles] = prepared;
  if (options.precision == Precision::f64)
    return std::make_unique<Solver<double>>(scene, options, particles, obstacles);
  if (runs_tuned(prepared)) return make_cuda_simulation(scene, options, particles, obstacles);
  return std::make_unique<Solver<float>>(scene, options, particles, obstacles);
}

std::unique_ptr<Simulation> Simulation::create(const Scene& scene, const SimulationOptions& options) {
  return create(PreparedScene(scene, options));
}

void Simulation::carry_tracers(const std::vector<Vec3f>&, const std::vector<Vec3f>&, const std::vector<double>&) {
  throw ConfigError("the tuned kernels for GPUs carry no tracers (allowed: portable ones). Use Kernels::portable");
}

std::unique_ptr<SceneBatch> SceneBatch::create(const std::vector<PreparedScene>& scenes) {
  GRAUPEL_ASSERT(!scenes.empty());
  const SceneGroups groups = groups_of_a_launch(scenes);
  return groups.size() == 1 ? make_group(scenes) : make_grouped(scenes, groups, make_group);
}

int64_t SceneBatch::particle_count() const {
  int64_t count = 0;
  for (int i = 0; i < scene_count(); ++i) count += static_cast<int64_t>(particle_type(i).size());
  return count;
}

Estimate estimate(const Scene& scene, const SimulationOptions& options) {
  const PreparedScene prepared(scene, options);
  if (options.precision == Precision::f64)
    return estimate_with<double>(scene, options, prepared.particles, prepared.obstacles);
  return estimate_with<float>(scene, options, prepared.particles, prepared.obstacles);
}

ParticleFrame frame_with_fields(const Simulation& simulation, FieldSet wanted) {
  ParticleFrame frame = simulation.frame();
  if (!wanted.empty()) frame.fields = simulation.fields(wanted);
  return frame;
}

}  // namespace graupel::mpm
