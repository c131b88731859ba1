// The explicit MPM solver of one scene in one precision: MLS-MPM with APIC
// transfers (Hu et al. 2018, Jiang et al. 2015), quadratic or cubic B-splines,
// symplectic Euler, in space or in the plane (plane strain).
#pragma once

#include <memory>
#include <vector>

#include "mpm/particles/host_particles.h"
#include "mpm/particles/state_bytes.h"
#include "mpm/phases/user_materials.h"
#include "mpm/sampling.h"
#include "mpm/simulation.h"
#include "mpm/solver/emitted_sound.h"
#include "mpm/solver/run_loads.h"
#include "mpm/solver/scene_grid.h"
#include "mpm/solver/time_step.h"
#include "mpm/solver/tracers.h"

namespace graupel::mpm {

template <typename T>
class Solver final : public Simulation {
 public:
  /// With `laws` of the caller's own, on the CPU. Throws ConfigError as laws_of().
  Solver(const Scene& scene, const SimulationOptions& options, const SampledParticles& particles,
         const sparsegrid::ObstacleSet& obstacles, const UserMaterials& laws = {});

  std::size_t particle_count() const override { return particle_type_.size(); }
  const std::vector<int32_t>& particle_type() const override { return particle_type_; }
  const sparsegrid::ObstacleSet& obstacles() const override { return obstacles_; }
  double time() const override { return static_cast<double>(frames_done_) * scene_.frame_time + frame_elapsed_; }
  void advance_frame() override;
  bool advance_substep() override;
  ParticleFrame frame() const override;
  ParticleFields fields(FieldSet wanted) const override;
  std::shared_ptr<const float> rows(ParticleQuantity what) const override;
  Diagnostics diagnostics() const override;
  RunStatistics statistics() const override;
  std::vector<ContactForce> contact_forces() const override;
  void carry_tracers(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                     const std::vector<double>& birth_time) override;
  std::vector<Vec3f> tracers() const override { return tracers_.positions(); }
  std::vector<uint8_t> active_tracers() const override { return tracers_.active(); }
  double tracer_seconds() const override { return tracer_seconds_; }
  std::vector<std::byte> save_state() const override;
  void load_state(const std::vector<std::byte>& state) override;

  /// One substep of the method [s].
  void substep(double dt);
  /// Particle state in slot order.
  HostParticles<T> particles() const { return download_particles(particles_); }
  /// For kernels; blocks and grid storage are those of the last
  /// sort_particles().
  SolverView<T> view() const { return grid_.view(particles_.view()); }
  void sort_particles() { grid_.sort(particles_.view()); }
  int64_t memory_bytes() const;
  /// Of the present state; of scripted bodies and emitters over the next
  /// frame_time.
  StateSpeeds speeds() const;

 private:
  void begin_frame();
  void end_frame();
  void reorder_particles();
  void push_loads(double dt);
  void record_step(double dt);
  void advance_particles(const SolverView<T>& v, double dt);
  void move_tracers(const SolverView<T>& v, double dt);
  void advance_particles_portably(const SolverView<T>& v, double dt);
  void deform(const SolverView<T>& v, T step) const;
  void move(const SolverView<T>& v, T step, double dt);
  StateOwner state_owner() const;
  std::size_t state_bytes() const;
  [[noreturn]] void throw_diverged(double dt, const StateSpeeds& before) const;

  Scene scene_;
  SimulationOptions options_;
  sparsegrid::ObstacleSet obstacles_;
  UserLaws user_laws_;  ///< of the materials; empty without any
  std::vector<int32_t> particle_type_;
  EmittedSound emitted_sound_;
  double diffusivity_ = 0;  ///< largest kinematic viscosity [m^2/s]

  mutable SceneGrid<T> grid_;  ///< views give kernels access to the arrays;
                               ///< const members only read them
  mutable Particles<T> particles_;
  Particles<T> spare_;  ///< target of the next reordering

  RunLoads<T> loads_;
  std::unique_ptr<ContactRecorder<T>> contacts_;  ///< where forces were asked for

  StepStatistics step_statistics_;  ///< of the present state
  int64_t frames_done_ = 0;
  double frame_elapsed_ = 0;  ///< [s] inside the present frame
  bool in_frame_ = false;     ///< begin_frame() was called for it
  double equal_step_ = 0;     ///< of the present frame [s]; 0 where steps adapt
  int64_t equal_steps_left_ = 0;
  RunStatistics statistics_;
  Tracers<T> tracers_;
  double tracer_seconds_ = 0;
};

extern template class Solver<float>;
extern template class Solver<double>;

}  // namespace graupel::mpm
