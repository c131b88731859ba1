#include "mpm/solver/solver.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "core/system/error.h"
#include "core/system/stop_signal.h"
#include "mpm/cpu/tuned_phases.h"
#include "mpm/materials/material.h"
#include "mpm/particles/particle_rows.h"
#include "mpm/phases/transfer_scheme.h"
#include "mpm/solver/divergence.h"

namespace graupel::mpm {

namespace {

/// The law's internal variable, and the stress of a deformation that particle i was given.
template <typename T>
void start_with_law(const UserMaterial& law, const SampledParticles& sampled, std::size_t i, HostParticles<T>& host) {
  host.internal[i] = static_cast<T>(law.initial_internal());
  if (sampled.given.empty()) return;
  const GivenState& given = sampled.given[i];
  MaterialState state{given.deformation_gradient, given.internal.value_or(law.initial_internal())};
  const Mat3d tau = law.stress({0, given.affine_velocity}, state);
  host.deformation_gradient[i] = state.F.cast<T>();
  host.internal[i] = static_cast<T>(state.internal);
  host.stress[i] = symmetric_components(tau.cast<T>());
}

}  // namespace

template <typename T>
Solver<T>::Solver(const Scene& scene, const SimulationOptions& options, const SampledParticles& sampled,
                  const sparsegrid::ObstacleSet& obstacles, const UserMaterials& laws)
    : scene_(scene),
      options_(options),
      obstacles_(obstacles),
      user_laws_(laws_of(sampled.material_names, laws)),
      grid_(options, with_carriers(scene, laws), sampled, obstacles, static_cast<int64_t>(sampled.position.size())),
      loads_(options.device, scene.loads, sampled.position.size()) {
  if (options.contact_forces) contacts_ = std::make_unique<ContactRecorder<T>>(options.device, scene);
  grid_.contacts = contacts_.get();
  for (const MaterialConfig& m : grid_.material_configs)
    if (is_fluid(m.model)) diffusivity_ = std::max(diffusivity_, m.viscosity / m.density);
  for (const int32_t m : sampled.material)
    particle_type_.push_back(particle_type_of(scene.materials.at(sampled.material_names[m]).model));
  HostParticles<T> initial = initial_particles<T>(sampled, grid_.material_configs);
  for (std::size_t i = 0; i < initial.size() && !user_laws_.empty(); ++i)
    if (const auto& law = user_laws_[initial.material[i]]) start_with_law(*law, sampled, i, initial);
  emitted_sound_ = EmittedSound(scene, sampled, initial, grid_.material_configs, user_laws_);
  particles_ = upload_particles(initial, options.device);
  spare_ = Particles<T>(options.device, particles_.count());
  find_owner_blocks(view());
  step_statistics_ = particle_statistics(view(), grid_.records);
  if (!user_laws_.empty()) add_user_statistics(view(), T(0), user_laws_, step_statistics_);
  constexpr double forever = std::numeric_limits<double>::infinity();
  check_scripted_speed(scene,
                       std::max(grid_.moving.largest_speed(0, forever), grid_.lifecycle.largest_speed(0, forever)));
}

template <typename T>
StateSpeeds Solver<T>::speeds() const {
  const double from = time(), to = from + scene_.frame_time;
  return {std::max(std::sqrt(step_statistics_.largest_speed2), grid_.lifecycle.largest_speed(from, to)),
          std::max(step_statistics_.largest_sound_speed, emitted_sound_.largest(from, to)), diffusivity_,
          grid_.moving.largest_speed(from, to),
          scene_.largest_gravity() * scene_.frame_time + loads_.largest_gain(from, scene_.frame_time)};
}

template <typename T>
void Solver<T>::substep(double dt) {
  push_loads(dt);
  const SolverView<T> v = grid_.move_nodes(particles_.view(), time(), dt, statistics_.scripted_momentum);
  if (grid_.tuned)
    advance_particles(v, dt);
  else
    advance_particles_portably(v, dt);
  move_tracers(v, dt);
}

template <typename T>
void Solver<T>::push_loads(double dt) {
  if (!loads_.act(time(), dt)) return;
  grid_.lifecycle.begin_step(time(), dt);  // who is led
  statistics_.load_momentum += loads_.push(view(), time(), dt);
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
void Solver<T>::carry_tracers(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                              const std::vector<double>& birth_time) {
  std::vector<double> birth = birth_time;
  if (birth.empty() && scene_.has_inactive_particles()) birth.assign(position.size(), 0.0);
  tracers_ = Tracers<T>(options_.device, position, velocity, birth, time());
}

/// Fuses grid-to-particle, deformation update and advection where no phase between them is needed.
template <typename T>
void Solver<T>::advance_particles(const SolverView<T>& v, double dt) {
  const T step = static_cast<T>(dt);
  const bool keeps_affine = scene_.transfer.scheme == TransferScheme::apic && scene_.transfer.damping == 0;
  const bool apart = grid_.lifecycle.has_scripts() || !user_laws_.empty();
  const bool at_once = keeps_affine && moves_plainly(v) && !contacts_;
  const AdvanceParts parts = apart     ? AdvanceParts::gather
                             : at_once ? AdvanceParts::all
                                       : AdvanceParts::gather_and_deform;
  step_statistics_ = advance_tuned(v, step, parts, grid_.records, grid_.instruction_set);
  if (parts == AdvanceParts::all) return;
  if (parts == AdvanceParts::gather) {
    grid_.lead(v, statistics_.scripted_momentum);
    deform(v, step);
  }
  move(v, step, dt);
}

template <typename T>
void Solver<T>::advance_particles_portably(const SolverView<T>& v, double dt) {
  const T step = static_cast<T>(dt);
  grid_to_particle(v);
  grid_.lead(v, statistics_.scripted_momentum);
  deform(v, step);
  move(v, step, dt);
}

template <typename T>
void Solver<T>::deform(const SolverView<T>& v, T step) const {
  if (user_laws_.empty())
    update_deformation(v, step);
  else
    update_deformation(v, step, user_laws_);
}

template <typename T>
void Solver<T>::move(const SolverView<T>& v, T step, double dt) {
  apply_transfer_scheme(view(), scene_.transfer, dt);
  if (contacts_) contacts_->add_push_out(v, time(), dt);
  step_statistics_ = move_particles(v, step, grid_.records);
  if (!user_laws_.empty()) add_user_statistics(v, step, user_laws_, step_statistics_);
}

template <typename T>
void Solver<T>::advance_frame() {
  while (!advance_substep()) give_up_if_stopped();
}

template <typename T>
bool Solver<T>::advance_substep() {
  const auto begin = std::chrono::steady_clock::now();
  if (!in_frame_) begin_frame();
  if (frame_elapsed_ >= scene_.frame_time) {  // of a state that was saved so
    end_frame();
    return true;
  }
  const StateSpeeds before = speeds();
  const double left = scene_.frame_time - frame_elapsed_;
  const bool equal_steps = equal_step_ > 0;
  const double dt =
      equal_steps ? equal_step_ : next_step(scene_.time_step, scene_.domain.dx, scene_.frame_time, before, left);
  substep(dt);
  record_step(dt);
  if (step_statistics_.bad_slot >= 0) throw_diverged(dt, before);
  const bool last = equal_steps ? --equal_steps_left_ <= 0 : dt >= left * (1 - 1e-9);
  frame_elapsed_ += dt;
  if (last) end_frame();
  statistics_.solver_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return last;
}

template <typename T>
void Solver<T>::begin_frame() {
  reorder_particles();
  const TimeStep& policy = scene_.time_step;
  loads_.expect(view(), time(), scene_.frame_time);
  equal_step_ =
      policy.policy == StepPolicy::adaptive ? 0 : largest_step(policy, scene_.domain.dx, scene_.frame_time, speeds());
  equal_steps_left_ = equal_step_ > 0 ? std::llround((scene_.frame_time - frame_elapsed_) / equal_step_) : 0;
  in_frame_ = true;
  if (contacts_) contacts_->begin_frame();
}

template <typename T>
void Solver<T>::end_frame() {
  in_frame_ = false;
  ++frames_done_;
  frame_elapsed_ = 0;
  const double n = static_cast<double>(particle_count());
  statistics_.share_over_courant =
      std::max(statistics_.share_over_courant, static_cast<double>(step_statistics_.over_courant) / n);
}

/// Puts the particles into block order in memory. Done at the start of every
/// frame, so that the order inside a frame, and with it every sum, depends on
/// the state at the frame's start alone: a restarted run repeats it.
template <typename T>
void Solver<T>::reorder_particles() {
  find_owner_blocks(view());
  grid_.blocks.invalidate();
  grid_.blocks.update();
  permute_particles(particles_, spare_, grid_.blocks.view().order);
  std::swap(particles_, spare_);
  find_owner_blocks(view());
  grid_.blocks.invalidate();
}

template <typename T>
void Solver<T>::record_step(double dt) {
  statistics_.substeps += 1;
  statistics_.last_step = dt;
  statistics_.pushed_out += step_statistics_.pushed_out;
  statistics_.born += step_statistics_.born;
  statistics_.removed += step_statistics_.removed;
  for (int d = 0; d < 3; ++d) statistics_.pushed_out_momentum[d] += step_statistics_.pushed_momentum[d];
  statistics_.sound_courant =
      std::max(statistics_.sound_courant, step_statistics_.largest_sound_speed * dt / scene_.domain.dx);
}

template <typename T>
void Solver<T>::throw_diverged(double dt, const StateSpeeds& before) const {
  const HostParticles<T> host = particles();
  const auto slot = static_cast<std::size_t>(step_statistics_.bad_slot);
  DivergedParticle bad;
  bad.index = host.source_index[slot];
  bad.speed = static_cast<double>(norm(host.velocity[slot]));
  bad.internal = static_cast<double>(host.internal[slot]);
  bad.substeps = statistics_.substeps;
  bad.time = time();
  bad.dt = dt;
  bad.before = before;
  bad.wave = fastest_at_rest(grid_.material_configs);
  for (std::size_t m = 0; m < user_laws_.size(); ++m) {
    if (!user_laws_[m]) continue;
    const double speed = user_laws_[m]->sound_speed({Mat3d::identity(), user_laws_[m]->initial_internal()});
    if (speed > bad.wave.speed) bad.wave = {speed, grid_.material_configs[m].name};
  }
  bad.largest_number = static_cast<double>(std::numeric_limits<T>::max());
  const auto material = static_cast<std::size_t>(host.material[slot]);
  if (user_laws_.empty() || !user_laws_[material]) mpm::throw_diverged(scene_, grid_.material_configs[material], bad);
  bad.internal = 1;  // the law's own, no volume ratio
  mpm::throw_diverged(scene_, scene_.materials.at(grid_.material_configs[material].name), bad);
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
  set_active(frame, grid_.lifecycle.active());
  return frame;
}

template <typename T>
ParticleFields Solver<T>::fields(FieldSet wanted) const {
  return fields_of(particles(), wanted, grid_.lifecycle.active());
}

template <typename T>
std::shared_ptr<const float> Solver<T>::rows(ParticleQuantity what) const {
  return gather_rows(particles_, what, grid_.lifecycle.active());
}

template <typename T>
Diagnostics Solver<T>::diagnostics() const {
  const HostParticles<T> host = particles();
  const std::vector<uint8_t> active = grid_.lifecycle.active();
  Diagnostics sum = diagnose(host, grid_.material_configs, scene_, active, time());
  if (!user_laws_.empty()) sum.elastic_energy += user_energy(host, user_laws_, active);
  return sum;
}

template <typename T>
RunStatistics Solver<T>::statistics() const {
  RunStatistics s = statistics_;
  s.active_blocks = grid_.blocks.view().owner_count;
  s.peak_bytes = memory_bytes();
  s.loads_without_carriers = loads_.without_carriers();
  return s;
}

template <typename T>
std::vector<ContactForce> Solver<T>::contact_forces() const {
  return contacts_ ? contacts_->forces(time()) : std::vector<ContactForce>{};
}

template <typename T>
int64_t Solver<T>::memory_bytes() const {
  return particles_.bytes() + spare_.bytes() + grid_.bytes();
}

template class Solver<float>;
template class Solver<double>;

}  // namespace graupel::mpm
