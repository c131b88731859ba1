#include "mpm/cuda_simulation.h"

#include <chrono>
#include <cstring>

#include "core/error.h"
#include "mpm/batch_solver.h"
#include "mpm/batch_state.h"
#include "mpm/cuda_backend.cuh"
#include "mpm/divergence.h"
#include "mpm/scene_hash.h"

namespace graupel::mpm {

namespace {

class CudaSimulation final : public Simulation {
 public:
  CudaSimulation(const Scene& scene, const SimulationOptions& options, const SampledParticles& particles,
                 const sparsegrid::ObstacleSet& obstacles)
      : options_(options), solver_(backend_, entries_of(scene, particles, obstacles)) {}

  std::size_t particle_count() const override { return particle_type().size(); }
  const std::vector<int32_t>& particle_type() const override { return solver_.setup(0).particle_type; }
  const sparsegrid::ObstacleSet& obstacles() const override { return solver_.setup(0).obstacles; }
  double time() const override {
    const StepControl& c = solver_.control(0);
    return static_cast<double>(frames_done_) * scene().frame_time + (c.phase == ScenePhase::frame_done ? 0 : c.elapsed);
  }
  void advance_frame() override;
  ParticleFrame frame() const override {
    ParticleFrame f = solver_.frame();
    f.time = time();
    return f;
  }
  ParticleFields fields(FieldSet wanted) const override { return fields_of(solver_.particles(), wanted); }
  Diagnostics diagnostics() const override {
    return diagnose(solver_.particles(), solver_.setup(0).material_configs, scene());
  }
  RunStatistics statistics() const override;
  std::vector<std::byte> save_state() const override { return save_batch(solver_, state_owner(), frames_done_); }
  void load_state(const std::vector<std::byte>& state) override {
    frames_done_ = load_batch(solver_, state_owner(), state);
  }

 private:
  static std::vector<BatchEntry> entries_of(const Scene& scene, const SampledParticles& particles,
                                            const sparsegrid::ObstacleSet& obstacles) {
    std::vector<BatchEntry> entries;
    entries.push_back({scene, particles, obstacles});
    return entries;
  }
  const Scene& scene() const { return solver_.setup(0).scene; }
  StateOwner state_owner() const {
    return {scene_hash(scene(), options_.seed), SolverKind::gpu_tuned, sizeof(float),
            static_cast<int64_t>(particle_count())};
  }
  [[noreturn]] void throw_stopped() const;

  SimulationOptions options_;
  CudaBackend backend_;
  mutable BatchSolver<CudaBackend> solver_;  ///< saving reads its arrays in place
  int64_t frames_done_ = 0;
  double seconds_ = 0;
};

void CudaSimulation::advance_frame() {
  const auto begin = std::chrono::steady_clock::now();
  solver_.advance_frame();
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (solver_.control(0).phase != ScenePhase::frame_done) throw_stopped();
  ++frames_done_;
}

void CudaSimulation::throw_stopped() const {
  const StepControl& c = solver_.control(0);
  if (c.phase == ScenePhase::too_stiff)
    next_step(scene().time_step, scene().domain.dx, scene().frame_time,
              {c.speed, c.sound_speed, solver_.setup(0).diffusivity},
              scene().frame_time - c.elapsed);  // throws
  const HostParticles<float> host = solver_.particles();
  DivergedParticle bad;
  bad.index = c.bad_particle;
  bad.substeps = c.substeps;
  bad.dt = static_cast<double>(c.dt);
  bad.time = time();
  bad.before = {c.before_speed, c.before_sound, solver_.setup(0).diffusivity};
  const auto slot = static_cast<std::size_t>(
      std::find(host.source_index.begin(), host.source_index.end(), c.bad_particle) - host.source_index.begin());
  bad.speed = static_cast<double>(norm(host.velocity.at(slot)));
  bad.internal = static_cast<double>(host.internal[slot]);
  throw_diverged(scene(), solver_.setup(0).material_configs[static_cast<std::size_t>(host.material[slot])], bad);
}

RunStatistics CudaSimulation::statistics() const {
  const StepControl& c = solver_.control(0);
  RunStatistics s;
  s.substeps = c.substeps;
  s.last_step = static_cast<double>(c.dt);
  s.pushed_out = c.pushed_out;
  for (int d = 0; d < 3; ++d) s.pushed_out_momentum[d] = static_cast<double>(c.pushed_momentum[d]) * momentum_unit;
  s.sound_courant = c.sound_courant;
  s.share_over_courant = static_cast<double>(c.over_courant) / static_cast<double>(particle_count());
  s.active_blocks = solver_.active_blocks();
  s.peak_bytes = solver_.memory_bytes();
  s.solver_seconds = seconds_;
  return s;
}

class CudaBatch final : public SceneBatch {
 public:
  explicit CudaBatch(std::vector<BatchEntry> entries) : solver_(backend_, std::move(entries)) {}

  int scene_count() const override { return solver_.scene_count(); }
  int64_t particle_count() const override { return solver_.first_particle(scene_count()); }
  void advance_frame() override {
    const auto begin = std::chrono::steady_clock::now();
    solver_.advance_frame();
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  bool diverged(int scene) const override { return solver_.control(scene).phase != ScenePhase::frame_done; }
  RunStatistics statistics() const override {
    RunStatistics s;
    for (int i = 0; i < scene_count(); ++i) s.substeps = std::max(s.substeps, solver_.control(i).substeps);
    s.active_blocks = solver_.active_blocks();
    s.peak_bytes = solver_.memory_bytes();
    s.solver_seconds = seconds_;
    return s;
  }

 private:
  CudaBackend backend_;
  BatchSolver<CudaBackend> solver_;
  double seconds_ = 0;
};

}  // namespace

std::unique_ptr<SceneBatch> make_cuda_batch(const std::vector<Scene>& scenes,
                                            const std::vector<SampledParticles>& particles,
                                            const std::vector<sparsegrid::ObstacleSet>& obstacles) {
  std::vector<BatchEntry> entries;
  for (std::size_t i = 0; i < scenes.size(); ++i) entries.push_back({scenes[i], particles[i], obstacles[i]});
  return std::make_unique<CudaBatch>(std::move(entries));
}

std::unique_ptr<Simulation> make_cuda_simulation(const Scene& scene, const SimulationOptions& options,
                                                 const SampledParticles& particles,
                                                 const sparsegrid::ObstacleSet& obstacles) {
  return std::make_unique<CudaSimulation>(scene, options, particles, obstacles);
}

}  // namespace graupel::mpm
