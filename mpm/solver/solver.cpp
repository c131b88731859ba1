#include "mpm/solver/solver.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "core/system/error.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/materials/material.h"
#include "mpm/phases/transfer_form.h"
#include "mpm/solver/divergence.h"

namespace graupel::mpm {

template <typename T>
Solver<T>::Solver(const Scene& scene, const SimulationOptions& options, const SampledParticles& sampled,
                  const sparsegrid::ObstacleSet& obstacles)
    : scene_(scene),
      options_(options),
      obstacles_(obstacles),
      grid_(grid_of<T>(scene.domain)),
      walls_(wall_view<T>(scene)),
      materials_(options.device, 0),
      blocks_(options.device, grid_.blocks, scene.domain.axes(), static_cast<int64_t>(sampled.position.size())),
      moving_(options.device, scene, obstacles),
      roles_(options.device, scene, sampled),
      obstacle_nodes_(options.device, grid_, moving_.fixed(), scene.domain.axes()),
      arenas_(options.device, 0),
      nodes_(options.device, 0),
      joined_(options.device, 0),
      records_(options.device, 0),
      impulses_(options.device, 0),
      instruction_set_(options.instruction_set.value_or(instruction_set())) {
  if (scene.domain.has_wall(Wall::periodic)) blocks_.keep_node_lookup();
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
  check_fixed_step();
}

template <typename T>
StateSpeeds Solver<T>::speeds() const {
  const double from = time(), to = from + scene_.frame_time;
  return {std::max(std::sqrt(survey_.largest_speed2), roles_.largest_speed(from, to)), survey_.largest_sound_speed,
          diffusivity_, moving_.largest_speed(from, to)};
}

/// A fixed step must not let a scripted body cross over one cell.
template <typename T>
void Solver<T>::check_fixed_step() const {
  if (scene_.time_step.policy != StepPolicy::fixed) return;
  constexpr double forever = std::numeric_limits<double>::infinity();
  const double dt = scene_.frame_time / static_cast<double>(scene_.time_step.substeps_per_frame);
  const double speed = std::max(moving_.largest_speed(0, forever), roles_.largest_speed(0, forever));
  const double cells = speed * dt / scene_.domain.dx;
  if (cells > 1)
    throw ConfigError(fmt::format(
        "a scripted body or an emitter moves {:.3g} cells in a substep of {:.4g} s (at {:.4g} m/s, allowed: 1). Use at "
        "least {} substeps_per_frame, time_step.policy adaptive, or a slower motion",
        cells, dt, speed, static_cast<int64_t>(std::ceil(speed * scene_.frame_time / scene_.domain.dx))));
}

template <typename T>
void Solver<T>::substep(double dt) {
  const T step = static_cast<T>(dt);
  const bool tuned = options_.device == Device::cpu && options_.kernels == Kernels::tuned &&
                     !scene_.domain.is_plane() && scene_.transfer.spline == Spline::quadratic;
  sort_particles();
  if (moving_.any()) moving_.begin_step(time(), dt);
  roles_.begin_step(time(), dt);
  SolverView<T> v = view();
  if (roles_.has_scripts()) statistics_.scripted_momentum += lead_particles(v, impulses_);
  const bool periodic = v.blocks.node_of_key != nullptr;
  if (tuned)
    particle_to_grid_tuned(v, step, instruction_set_, periodic ? GridParts::sums : GridParts::velocities);
  else
    particle_to_grid(v, step);
  if (periodic) {
    joined_.resize_discard(nodes_.size());
    join_periodic(v, joined_.data());
    std::swap(nodes_, joined_);
    v = view();
  }
  if (periodic || !tuned) update_grid(v, step);
  if (tuned)
    advance_particles(v, dt);
  else
    advance_particles_portably(v, dt);
  move_tracers(v, dt);
}

/// With the velocities of the nodes, which stay until the next substep.
template <typename T>
void Solver<T>::move_tracers(const SolverView<T>& v, double dt) {
  if (!tracers_.any()) return;
  const auto begin = std::chrono::steady_clock::now();
  tracers_.move(v, static_cast<T>(dt));
  tracer_seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

template <typename T>
void Solver<T>::carry_tracers(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity) {
  check_carries_tracers(scene_);
  tracers_ = Tracers<T>(options_.device, position, velocity);
}

/// Fuses grid-to-particle, deformation update and advection where no phase between them is needed.
template <typename T>
void Solver<T>::advance_particles(const SolverView<T>& v, double dt) {
  const T step = static_cast<T>(dt);
  const bool keeps_affine = scene_.transfer.scheme == TransferScheme::apic && scene_.transfer.damping == 0;
  const AdvanceParts parts = roles_.has_scripts()               ? AdvanceParts::gather
                             : keeps_affine && moves_plainly(v) ? AdvanceParts::all
                                                                : AdvanceParts::gather_and_deform;
  survey_ = advance_tuned(v, step, parts, records_, instruction_set_);
  if (parts == AdvanceParts::all) return;
  if (parts == AdvanceParts::gather) {
    statistics_.scripted_momentum += lead_particles(v, impulses_);
    update_deformation(v, step);
  }
  carry_affine(dt);
  survey_ = move_particles(v, step, records_);
}

template <typename T>
void Solver<T>::advance_particles_portably(const SolverView<T>& v, double dt) {
  const T step = static_cast<T>(dt);
  grid_to_particle(v);
  if (roles_.has_scripts()) statistics_.scripted_momentum += lead_particles(v, impulses_);
  update_deformation(v, step);
  carry_affine(dt);
  survey_ = move_particles(v, step, records_);
}

template <typename T>
void Solver<T>::carry_affine(double dt) {
  const TransferConfig& transfer = scene_.transfer;
  if (transfer.scheme == TransferScheme::apic && transfer.damping == 0) return;
  const double kept = std::exp(-transfer.damping * dt);
  const double symmetric = transfer.scheme == TransferScheme::apic ? kept : 0;
  const double rotation = transfer.scheme == TransferScheme::pic ? 0 : kept;
  blend_affine(view(), static_cast<T>(symmetric), static_cast<T>(rotation));
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
  // With room for more: while material spreads there are more blocks in every substep.
  const auto make_room = [](Buffer<T>& buffer, std::size_t n) {
    if (n > buffer.size()) buffer.resize_discard(n + n / 4);
  };
  with_form(view(), [&](auto form) {
    constexpr int D = decltype(form)::D;
    const BlockView b = blocks_.view();
    if (options_.device == Device::cpu)
      make_room(arenas_, static_cast<std::size_t>(b.home_count) * arena_size<D, decltype(form)::spline>);
    make_room(nodes_, static_cast<std::size_t>(b.node_count) * nodes_per_block<D> * channels);
  });
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
  statistics_.born += survey_.born;
  statistics_.removed += survey_.removed;
  for (int d = 0; d < 3; ++d) statistics_.pushed_out_momentum[d] += survey_.pushed_momentum[d];
  statistics_.sound_courant = std::max(statistics_.sound_courant, survey_.largest_sound_speed * dt / scene_.domain.dx);
}

template <typename T>
void Solver<T>::throw_diverged(double dt, const StateSpeeds& before) const {
  const HostParticles<T> host = particles();
  const auto slot = static_cast<std::size_t>(survey_.bad_slot);
  DivergedParticle bad;
  bad.index = host.source_index[slot];
  bad.speed = static_cast<double>(norm(host.velocity[slot]));
  bad.internal = static_cast<double>(host.internal[slot]);
  bad.substeps = statistics_.substeps;
  bad.time = time();
  bad.dt = dt;
  bad.before = before;
  mpm::throw_diverged(scene_, material_configs_[static_cast<std::size_t>(host.material[slot])], bad);
}

template <typename T>
SolverView<T> Solver<T>::view() const {
  auto& self = const_cast<Solver&>(*this);  // views give kernels access to the arrays; const members only read them
  SolverView<T> v;
  v.grid = grid_;
  v.walls = walls_;
  v.gravity = scene_.gravity.template cast<T>();
  v.push_out = scene_.push_out;
  v.obstacle_nodes = obstacle_nodes_.view();
  v.materials = materials_.data();
  v.device = options_.device;
  v.particles = particles_.view();
  v.blocks = blocks_.view();
  v.moving = moving_.view();
  v.roles = roles_.view();
  v.dimensions = scene_.domain.axes();
  v.spline = scene_.transfer.spline;
  v.arenas = self.arenas_.data();
  v.nodes = self.nodes_.data();
  v.keys = self.blocks_.keys();
  v.keys_changed = self.blocks_.changed_flag();
  v.some_stationary = some_stationary_;
  return v;
}

template <typename T>
ParticleFrame Solver<T>::frame() const {
  const HostParticles<T> host = particles();
  ParticleFrame frame;
  frame.time = time();
  frame.active = roles_.active();
  frame.position.resize(particle_count());
  frame.velocity.resize(particle_count());
  for (std::size_t slot = 0; slot < particle_count(); ++slot) {
    frame.position[host.source_index[slot]] = host.position[slot].template cast<float>();
    frame.velocity[host.source_index[slot]] = host.velocity[slot].template cast<float>();
  }
  for (std::size_t i = 0; i < frame.active.size(); ++i)
    if (frame.active[i] == 0) frame.velocity[i] = Vec3f::zero();
  return frame;
}

template <typename T>
ParticleFields Solver<T>::fields(FieldSet wanted) const {
  return fields_of(particles(), wanted, roles_.active());
}

template <typename T>
Diagnostics Solver<T>::diagnostics() const {
  return diagnose(particles(), material_configs_, scene_, roles_.active());
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
         static_cast<int64_t>((arenas_.size() + nodes_.size() + joined_.size()) * sizeof(T));
}

template class Solver<float>;
template class Solver<double>;

}  // namespace graupel::mpm
