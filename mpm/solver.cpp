#include "mpm/solver.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "mpm/material.h"

namespace graupel::mpm {

namespace {

constexpr double far_off = 1e30;  ///< [m]

Contact contact_of(Wall wall) {
  return wall == Wall::stick ? Contact::stick : wall == Wall::slip ? Contact::slip : Contact::separate;
}

/// A wall that holds the material, or a gate: then nothing holds it, and particles pass at the same plane.
template <typename T>
void set_wall(const Scene& scene, int axis, int side, WallView<T>& walls) {
  const Wall kind = scene.domain.wall(axis, side);
  const T away = static_cast<T>(side == 0 ? -far_off : far_off);
  walls.contact[axis][side] = contact_of(kind);
  walls.friction[axis][side] = static_cast<T>(scene.domain.friction(axis, side));
  T& held = (side == 0 ? walls.low : walls.high)[axis];
  T& gate = (side == 0 ? walls.gate_low : walls.gate_high)[axis];
  const bool is_gate = kind == Wall::open || kind == Wall::periodic;
  gate = is_gate ? held : away;
  if (side == 0) walls.periodic[axis] = {static_cast<int>(scene.domain.wall_cells), 0};
  if (!is_gate) return;
  walls.has_gates = true;
  held = away;
  (side == 0 ? walls.particle_low : walls.particle_high)[axis] = away;
  const double width = scene.wall_high()[axis] - scene.wall_low()[axis];
  if (kind != Wall::periodic) return;
  const double cells = width / scene.domain.dx;
  if (scene.domain.wall(axis, 1 - side) != kind || std::abs(cells - std::round(cells)) > 1e-6)
    throw ConfigError(fmt::format(
        "periodic walls need a partner at the other end of their axis and whole cells between them ({:.6g} cells along "
        "{}). Change the walls, the domain's size or dx",
        cells, "xyz"[axis]));
  walls.periodic[axis].cells = static_cast<int>(std::lround(cells));
}

/// Without push_out particles may creep past the walls, but never so far that their stencil leaves the grid.
template <typename T>
WallView<T> walls_of(const Scene& scene) {
  WallView<T> walls{};
  walls.low = scene.wall_low().cast<T>();
  walls.high = scene.wall_high().cast<T>();
  const Vec3d inset = Vec3d::filled(0.6 * scene.domain.dx);
  walls.particle_low = scene.push_out ? walls.low : (scene.domain.origin + inset).cast<T>();
  walls.particle_high = scene.push_out ? walls.high : (scene.domain.origin + scene.domain.size - inset).cast<T>();
  for (int d = 0; d < 3; ++d)
    for (int side = 0; side < 2; ++side) set_wall(scene, d, side, walls);
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
      moving_(options.device, scene, obstacles),
      roles_(options.device, scene, sampled),
      obstacle_nodes_(options.device, grid_, moving_.fixed()),
      arenas_(options.device, 0),
      nodes_(options.device, 0),
      joined_(options.device, 0),
      records_(options.device, 0),
      impulses_(options.device, 0) {
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
  sort_particles();
  if (moving_.any()) moving_.begin_step(time(), dt);
  roles_.begin_step(time(), dt);
  SolverView<T> v = view();
  if (roles_.has_scripts()) statistics_.scripted_momentum += lead_particles(v, impulses_);
  particle_to_grid(v, step);
  if (v.blocks.node_of_key != nullptr) {
    joined_.resize_discard(nodes_.size());
    join_periodic(v, joined_.data());
    std::swap(nodes_, joined_);
    v = view();
  }
  update_grid(v, step);
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
  statistics_.born += survey_.born;
  statistics_.removed += survey_.removed;
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
          moving_.view(),
          roles_.view(),
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
Diagnostics Solver<T>::diagnostics() const {
  return diagnose(particles(), material_configs_, scene_.domain.dx, scene_.gravity, roles_.active());
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
