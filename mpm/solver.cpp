#include "mpm/solver.h"

#include <fmt/format.h>

#include <chrono>
#include <cstring>

#include "core/error.h"
#include "mpm/material.h"

namespace graupel::mpm {

namespace {

/// Without push_out particles may creep past the walls, but never so far that their stencil leaves the grid.
template <typename T>
WallView<T> walls_of(const Scene& scene) {
  WallView<T> walls;
  walls.low = scene.wall_low().cast<T>();
  walls.high = scene.wall_high().cast<T>();
  const Vec3d inset = Vec3d::filled(0.6 * scene.domain.dx);
  walls.particle_low = scene.push_out ? walls.low : (scene.domain.origin + inset).cast<T>();
  walls.particle_high = scene.push_out ? walls.high : (scene.domain.origin + scene.domain.size - inset).cast<T>();
  walls.contact = scene.domain.walls;
  walls.friction = static_cast<T>(scene.domain.wall_friction);
  return walls;
}

}  // namespace

template <typename T>
Solver<T>::Solver(const Scene& scene, const SimulationOptions& options, const SampledParticles& sampled,
                  const sparsegrid::ObstacleSet& obstacles)
    : scene_(scene),
      options_(options),
      obstacles_(obstacles),
      grid_(grid_of<T>(scene.domain)),
      walls_(walls_of<T>(scene)),
      materials_(options.device, 0),
      blocks_(options.device, grid_.blocks, static_cast<int64_t>(sampled.position.size())),
      obstacle_nodes_(options.device, grid_, obstacles),
      arenas_(options.device, 0),
      nodes_(options.device, 0),
      records_(options.device, 0) {
  std::vector<MaterialParameters<T>> parameters;
  for (const std::string& name : sampled.material_names) {
    material_configs_.push_back(scene.materials.at(name));
    parameters.push_back(material_parameters<T>(material_configs_.back()));
  }
  materials_.upload(parameters);
  for (const MaterialConfig& m : material_configs_) {
    some_stationary_ = some_stationary_ || m.model == MaterialModel::stationary;
    if (m.model == MaterialModel::water) diffusivity_ = std::max(diffusivity_, m.viscosity / m.density);
  }
  for (const int32_t m : sampled.material) particle_type_.push_back(particle_type_of(material_configs_[m].model));
  const auto n = static_cast<int64_t>(sampled.position.size());
  particles_ = upload_particles(initial_particles<T>(sampled, material_configs_), options.device);
  spare_ = Particles<T>(options.device, n);
  find_home_blocks(view());
  survey_ = survey_particles(view(), records_);
}

template <typename T>
void Solver<T>::substep(double dt) {
  const T step = static_cast<T>(dt);
  sort_particles();
  const SolverView<T> v = view();
  particle_to_grid(v, step);
  update_grid(v, step);
  grid_to_particle(v);
  update_deformation(v, step);
  survey_ = move_particles(v, step, records_);
}

template <typename T>
void Solver<T>::advance_frame() {
  const auto begin = std::chrono::steady_clock::now();
  reorder_particles();
  const TimeStep& policy = scene_.time_step;
  for (int64_t i = 0; frame_elapsed_ < scene_.frame_time; ++i) {
    const StateSpeeds before = speeds();
    const bool fixed = policy.policy == StepPolicy::fixed;
    const double left = scene_.frame_time - frame_elapsed_;
    const double dt = fixed ? largest_step(policy, scene_.domain.dx, scene_.frame_time, before)
                            : next_step(policy, scene_.domain.dx, scene_.frame_time, before, left);
    substep(dt);
    record_step(dt);
    if (survey_.bad_slot >= 0) throw_diverged(dt, before);
    const bool last = fixed ? i + 1 == policy.substeps_per_frame : dt >= left * (1 - 1e-9);
    frame_elapsed_ = last ? scene_.frame_time : frame_elapsed_ + dt;
  }
  ++frames_done_;
  frame_elapsed_ = 0;
  const double n = static_cast<double>(particle_count());
  statistics_.share_over_courant =
      std::max(statistics_.share_over_courant, static_cast<double>(survey_.over_courant) / n);
  statistics_.solver_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Blocks in use and the particles of each; grid storage to match.
template <typename T>
void Solver<T>::sort_particles() {
  blocks_.update();
  const BlockView b = blocks_.view();
  if (options_.device == Device::cpu) arenas_.resize_discard(static_cast<std::size_t>(b.home_count) * arena_size<3>);
  nodes_.resize_discard(static_cast<std::size_t>(b.node_count) * nodes_per_block<3> * channels);
}

/// Puts the particles into block order in memory. Done at the start of every frame, so that the order inside a frame,
/// and with it every sum, depends on the state at the frame's start alone: a restarted run repeats it.
template <typename T>
void Solver<T>::reorder_particles() {
  find_home_blocks(view());
  blocks_.invalidate();
  blocks_.update();
  permute_particles(particles_, spare_, blocks_.view().order);
  std::swap(particles_, spare_);
  find_home_blocks(view());
  blocks_.invalidate();
}

template <typename T>
void Solver<T>::record_step(double dt) {
  statistics_.substeps += 1;
  statistics_.last_step = dt;
  statistics_.pushed_out += survey_.pushed_out;
  for (int d = 0; d < 3; ++d) statistics_.pushed_out_momentum[d] += survey_.pushed_momentum[d];
  statistics_.sound_courant = std::max(statistics_.sound_courant, survey_.largest_sound_speed * dt / scene_.domain.dx);
}

template <typename T>
void Solver<T>::throw_diverged(double dt, const StateSpeeds& before) const {
  const HostParticles<T> host = particles();
  const auto slot = static_cast<std::size_t>(survey_.bad_slot);
  const int32_t index = host.source_index[slot];
  const MaterialConfig& material = material_configs_[host.material[slot]];
  const double moved = static_cast<double>(norm(host.velocity[slot])) * dt / scene_.domain.dx;
  const T internal = host.internal[slot];
  const bool volume_lost = internal_variable_is_volume_ratio(material.model) && !(internal > T(0));
  const std::string what = volume_lost ? fmt::format("its volume ratio is {:.4g}, allowed: above 0", internal)
                           : std::isfinite(moved)
                               ? fmt::format("it would move {:.3g} cells in one substep, allowed: 1", moved)
                               : std::string("its state is not a number");
  const double suggested = suggested_step(scene_.domain.dx, before, dt);
  throw DivergedError(
      fmt::format("the simulation diverged at particle {} ({}, material '{}') in substep {} at t = {:.6g} s with a "
                  "step of {:.4g} s "
                  "({}). Use a step of at most {:.4g} s: time_step.policy adaptive, or substeps_per_frame {}",
                  index, particle_type_name(particle_type_of(material.model)), material.name, statistics_.substeps,
                  time(), dt, what, suggested, static_cast<int64_t>(std::ceil(scene_.frame_time / suggested))));
}

template <typename T>
SolverView<T> Solver<T>::view() const {
  auto& self = const_cast<Solver&>(*this);  // views give kernels access to the arrays; const members only read them
  return {options_.device,
          grid_,
          walls_,
          scene_.gravity.template cast<T>(),
          scene_.push_out,
          materials_.data(),
          particles_.view(),
          blocks_.view(),
          obstacle_nodes_.view(),
          self.arenas_.data(),
          self.nodes_.data(),
          self.blocks_.keys(),
          self.blocks_.changed_flag(),
          some_stationary_};
}

template <typename T>
ParticleFrame Solver<T>::frame() const {
  const HostParticles<T> host = particles();
  ParticleFrame frame;
  frame.time = time();
  frame.position.resize(particle_count());
  frame.velocity.resize(particle_count());
  for (std::size_t slot = 0; slot < particle_count(); ++slot) {
    frame.position[host.source_index[slot]] = host.position[slot].template cast<float>();
    frame.velocity[host.source_index[slot]] = host.velocity[slot].template cast<float>();
  }
  return frame;
}

template <typename T>
Diagnostics Solver<T>::diagnostics() const {
  return diagnose(particles(), material_configs_, scene_.domain.dx, scene_.gravity);
}

template <typename T>
RunStatistics Solver<T>::statistics() const {
  RunStatistics s = statistics_;
  s.active_blocks = blocks_.view().home_count;
  s.peak_bytes = memory_bytes();
  return s;
}

template <typename T>
int64_t Solver<T>::memory_bytes() const {
  return particles_.bytes() + spare_.bytes() + blocks_.bytes() + obstacle_nodes_.bytes() +
         static_cast<int64_t>((arenas_.size() + nodes_.size()) * sizeof(T));
}

template class Solver<float>;
template class Solver<double>;

}  // namespace graupel::mpm
