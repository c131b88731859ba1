#include "mpm/cuda_simulation.h"

#include <chrono>
#include <cstring>

#include "core/system/error.h"
#include "mpm/gpu/blocks/batch_results.h"
#include "mpm/gpu/blocks/batch_solver.h"
#include "mpm/gpu/blocks/batch_state.h"
#include "mpm/gpu/cuda_backend.cuh"
#include "mpm/gpu/small/small_scene_solver.h"
#include "mpm/particles/particle_rows.h"
#include "mpm/particles/state_check.h"
#include "mpm/scene/scene_hash.h"

namespace graupel::mpm {

namespace {

/// One scene. `BatchOf` is SmallSceneSolver or BatchSolver.
template <template <typename> class BatchOf>
class CudaSimulation final : public Simulation {
 public:
  CudaSimulation(const Scene& scene, const SimulationOptions& options, const SampledParticles& particles,
                 const sparsegrid::ObstacleSet& obstacles)
      : options_(options), solver_(backend_, entries_of(scene, particles, obstacles)) {}

  std::size_t particle_count() const override { return particle_type().size(); }
  const std::vector<int32_t>& particle_type() const override { return solver_.setup(0).particle_type; }
  const sparsegrid::ObstacleSet& obstacles() const override { return solver_.setup(0).obstacles; }
  double time() const override {
    const SceneProgress& c = solver_.control(0);
    return static_cast<double>(frames_done_) * scene().frame_time + (c.phase == ScenePhase::frame_done ? 0 : c.elapsed);
  }
  void advance_frame() override;
  ParticleFrame frame() const override {
    ParticleFrame f = solver_.frame();
    f.time = time();
    set_active(f, active());
    return f;
  }
  ParticleFields fields(FieldSet wanted) const override { return fields_of(solver_.particles(), wanted, active()); }
  std::shared_ptr<const float> rows(ParticleQuantity what) const override {
    return gather_rows(solver_.present_particles(), what, active());
  }
  Diagnostics diagnostics() const override {
    return diagnose(solver_.particles(), solver_.setup(0).material_configs, scene(), active());
  }
  RunStatistics statistics() const override;
  std::vector<std::byte> save_state() const override { return save_batch(solver_, state_owner(), frames_done_); }
  void load_state(const std::vector<std::byte>& state) override {
    frames_done_ = load_batch(solver_, state_owner(), state);
    check_state(solver_.particles(), solver_.presence(0).download(),
                static_cast<int32_t>(solver_.setup(0).material_configs.size()), scene().domain);
  }

 private:
  static std::vector<BatchEntry> entries_of(const Scene& scene, const SampledParticles& particles,
                                            const sparsegrid::ObstacleSet& obstacles) {
    std::vector<BatchEntry> entries;
    entries.push_back({scene, particles, obstacles});
    return entries;
  }
  const Scene& scene() const { return solver_.setup(0).scene; }
  std::vector<uint8_t> active() const { return solver_.setup(0).lifecycle.active(); }
  StateOwner state_owner() const {
    return {scene_hash(scene(), options_.seed), SolverKind::gpu_tuned, sizeof(float),
            static_cast<int64_t>(particle_count())};
  }

  SimulationOptions options_;
  CudaBackend backend_;
  mutable BatchOf<CudaBackend> solver_;  ///< saving reads its arrays in place
  int64_t frames_done_ = 0;
  double seconds_ = 0;
};

template <template <typename> class BatchOf>
void CudaSimulation<BatchOf>::advance_frame() {
  const auto begin = std::chrono::steady_clock::now();
  solver_.advance_frame();
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (solver_.control(0).phase != ScenePhase::frame_done) throw_stopped(solver_, 0, time());
  ++frames_done_;
}

template <template <typename> class BatchOf>
RunStatistics CudaSimulation<BatchOf>::statistics() const {
  const SceneProgress& c = solver_.control(0);
  RunStatistics s;
  s.substeps = c.substeps;
  s.last_step = static_cast<double>(c.dt);
  s.pushed_out = c.pushed_out;
  for (int d = 0; d < 3; ++d) {
    s.pushed_out_momentum[d] = static_cast<double>(c.pushed_momentum[d]) * momentum_unit;
    s.scripted_momentum[d] = static_cast<double>(c.scripted_momentum[d]) * momentum_unit;
  }
  solver_.setup(0).lifecycle.count(s.born, s.removed);
  s.sound_courant = c.sound_courant;
  s.share_over_courant = static_cast<double>(c.over_courant) / static_cast<double>(particle_count());
  s.active_blocks = solver_.active_blocks();
  s.peak_bytes = solver_.memory_bytes();
  s.solver_seconds = seconds_;
  return s;
}

/// The scenes of a batch that one kind of solver runs.
template <template <typename> class BatchOf>
class BatchPart {
 public:
  void add(int scene, BatchEntry entry) {
    scenes_.push_back(scene);
    entries_.push_back(std::move(entry));
  }
  void begin() {
    if (!entries_.empty()) solver_ = std::make_unique<BatchOf<CudaBackend>>(backend_, std::move(entries_));
  }
  void advance_frame() {
    if (solver_) solver_->advance_frame();
  }
  /// Calls visit(solver, number in it, number in the batch) for every scene.
  template <typename Visit>
  void for_scenes(const Visit& visit) const {
    for (std::size_t i = 0; i < scenes_.size(); ++i) visit(*solver_, static_cast<int>(i), scenes_[i]);
  }
  void give_frames(FieldSet wanted, int64_t frames_done, std::vector<ParticleFrame>& frames) const {
    if (!solver_) return;
    std::vector<ParticleFrame> own = frames_of_scenes(*solver_, wanted, frames_done);
    for (std::size_t i = 0; i < scenes_.size(); ++i) frames[static_cast<std::size_t>(scenes_[i])] = std::move(own[i]);
  }
  void give_rows(ParticleQuantity what, std::vector<std::shared_ptr<const float>>& rows) const {
    if (!solver_) return;
    const std::shared_ptr<const float> all =
        gather_rows(solver_->present_particles(), what, active_of_scenes(*solver_));
    for (std::size_t i = 0; i < scenes_.size(); ++i)
      rows[static_cast<std::size_t>(scenes_[i])] = {
          all, all.get() + components_of(what) * solver_->first_particle(static_cast<int>(i))};
  }
  int64_t active_blocks() const { return solver_ ? solver_->active_blocks() : 0; }
  int64_t memory_bytes() const { return solver_ ? solver_->memory_bytes() : 0; }

 private:
  std::vector<int> scenes_;
  std::vector<BatchEntry> entries_;
  CudaBackend backend_;
  std::unique_ptr<BatchOf<CudaBackend>> solver_;
};

/// Small scenes, those of them that change, and the others, each kind with its solver.
class CudaBatch final : public SceneBatch {
 public:
  explicit CudaBatch(std::vector<BatchEntry> entries) : divergence_(entries.size()), types_(entries.size()) {
    for (std::size_t i = 0; i < entries.size(); ++i) {
      const auto scene = static_cast<int>(i);
      if (!is_small_scene(entries[i].scene, entries[i].particles.position.size()))
        others_.add(scene, std::move(entries[i]));
      else if (is_changing_scene(entries[i].scene))
        changing_.add(scene, std::move(entries[i]));
      else
        small_.add(scene, std::move(entries[i]));
    }
    small_.begin();
    changing_.begin();
    others_.begin();
    for_scenes([&](const auto& solver, int number, int scene) {
      types_[static_cast<std::size_t>(scene)] = &solver.setup(number).particle_type;
    });
  }

  int scene_count() const override { return static_cast<int>(types_.size()); }
  const std::vector<int32_t>& particle_type(int scene) const override {
    return *types_[static_cast<std::size_t>(scene)];
  }
  bool advance_frame(const std::function<bool()>& stop) override;
  std::optional<std::string> divergence(int scene) const override {
    return divergence_[static_cast<std::size_t>(scene)];
  }
  std::vector<ParticleFrame> frames(FieldSet wanted) const override {
    std::vector<ParticleFrame> all(types_.size());
    small_.give_frames(wanted, frames_done_, all);
    changing_.give_frames(wanted, frames_done_, all);
    others_.give_frames(wanted, frames_done_, all);
    return all;
  }
  std::vector<std::shared_ptr<const float>> rows(ParticleQuantity what) const override {
    std::vector<std::shared_ptr<const float>> all(types_.size());
    small_.give_rows(what, all);
    changing_.give_rows(what, all);
    others_.give_rows(what, all);
    return all;
  }
  RunStatistics statistics() const override {
    RunStatistics s;
    for_scenes([&](const auto& solver, int number, int) {
      s.substeps = std::max(s.substeps, solver.control(number).substeps);
    });
    s.active_blocks = others_.active_blocks();
    s.peak_bytes = small_.memory_bytes() + changing_.memory_bytes() + others_.memory_bytes();
    s.solver_seconds = seconds_;
    return s;
  }

 private:
  template <typename Visit>
  void for_scenes(const Visit& visit) const {
    small_.for_scenes(visit);
    changing_.for_scenes(visit);
    others_.for_scenes(visit);
  }

  std::vector<std::optional<std::string>> divergence_;
  std::vector<const std::vector<int32_t>*> types_;
  BatchPart<SmallSceneSolver> small_, changing_;
  BatchPart<BatchSolver> others_;
  int64_t frames_done_ = 0;
  double seconds_ = 0;
};

bool CudaBatch::advance_frame(const std::function<bool()>& /*stop*/) {
  const auto begin = std::chrono::steady_clock::now();
  small_.advance_frame();
  changing_.advance_frame();
  others_.advance_frame();
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  for_scenes([&](const auto& solver, int number, int scene) {
    if (solver.control(number).phase != ScenePhase::frame_done && !divergence(scene))
      divergence_[static_cast<std::size_t>(scene)] = why_stopped(solver, number, frames_done_);
  });
  ++frames_done_;
  return true;
}

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
  if (is_small_scene(scene, particles.position.size()))
    return std::make_unique<CudaSimulation<SmallSceneSolver>>(scene, options, particles, obstacles);
  return std::make_unique<CudaSimulation<BatchSolver>>(scene, options, particles, obstacles);
}

}  // namespace graupel::mpm
