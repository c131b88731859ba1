// A learned simulator: predicts the next frame from the last ones, and rolls out a scene (HGN paper, algorithm 1).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "graph/features/features.h"
#include "graph/features/particle_lifecycle.h"
#include "graph/features/particle_schedule.h"
#include "graph/network.h"

namespace graupel::graph {

class CudaBatch;
class CudaSimulator;

/// On a GPU not to be used from several threads at once.
class LearnedSimulator {
 public:
  /// Throws InputError for a file that is missing, damaged or holds no graph network.
  explicit LearnedSimulator(const std::string& weights_file);
  explicit LearnedSimulator(std::shared_ptr<const nn::Weights> weights);
  const FeatureConfig& config() const;
  const nn::Weights& weights() const;
  /// Throws ConfigError where the network cannot run on a device: there is no GPU, or what it has is not done there.
  void check_runs_on(Device device) const;
  /// Throws what rollout() throws of a scene whose environment has the scene's cell size, before any frame: another
  /// frame time, cell size or number of dimensions, obstacle particles in a plane; InputError for unknown materials.
  void check_scene(const Scene& scene) const;

  /// Accelerations per frame^2 [m], shape [n], from history + 1 positions, newest last: those of the next frame, the
  /// first one of a bundle. `environment` is that of the frame to come, the particles are those in the run. `material`
  /// [n]: as RolloutOptions has it.
  std::vector<Vec3f> one_step(const Environment& environment, const std::vector<int32_t>& particle_type,
                              const std::vector<std::vector<Vec3f>>& positions, FrameTiming* timing = nullptr,
                              const std::vector<int32_t>& material = {}) const;
  /// The same on a GPU, as rollouts there have it. Throws ConfigError without one.
  std::vector<Vec3f> one_step_on_gpu(const Scene& scene, const Environment& environment,
                                     const std::vector<int32_t>& particle_type,
                                     const std::vector<std::vector<Vec3f>>& positions,
                                     const std::vector<int32_t>& material = {}) const;
  /// Floating-point operations of the network for one frame of particles at `position`, a frame's share of those of a
  /// bundle (graph/plan/layer_plan.h).
  double flop(const Environment& environment, const std::vector<Vec3f>& position) const;

  /// Where kinematic particles (core/scene/kinematic_particles.h) are: positions [frames][n] after the start, of which
  /// theirs count. Beyond the last frame they stay.
  using GivenFrames = std::vector<std::vector<Vec3f>>;
  struct RolloutOptions {
    int64_t frames = 300;
    std::function<void(int64_t frame, const FrameTiming&)> progress;
    bool project = true;  ///< out of obstacles, into the walls
    double density_limit =
        1;  ///< largest density, of that at rest (graph/features/rest_density.h); 0: none; in space alone
    bool free_flight =
        true;  ///< momentum of what flies is kept (graph/corrections/free_flight.h); not beside kinematic particles
    bool network = true;  ///< false: nothing but gravity and these laws, at the network's settings
    const GivenFrames* given = nullptr;
    const ParticleSchedule* schedule = nullptr;  ///< births and scripts; null: none
    double start_time = 0;                       ///< [s] of the newest start frame
    /// [n] indices into the environment's materials, or no_material, for networks that see constants; empty: by the
    /// particles' types (MaterialTable::by_type)
    std::vector<int32_t> material = {};
    std::vector<uint8_t> active = {};  ///< [n] 1 for those in the run at the start; empty: all that are born
    Device device = Device::cpu;       ///< on a GPU matrix products are in bf16, and latents have to be 128 wide
  };
  /// Predicts options.frames frames after `start` (history + 1 positions or more, newest last; see start_history). The
  /// network is evaluated every config().bundle frames, from then newest ones; the last bundle may be cut. The
  /// result holds the newest start frame and the predicted ones, with velocities as frame differences over the frame
  /// time; a rollout with a NaN or a speed over one domain edge a frame stops before that frame and sets
  /// diverged_at_frame. Throws ConfigError when the scene's frame time
  /// or the cell size of the obstacle normals is not the one that the network was trained for, or it has another number
  /// of dimensions.
  /// Kinematic particles take their given places, or stay where they start; the others see them, and the density is
  /// that of the others. Obstacles are where their scripts have them in each frame; frames of scenes where particles
  /// come and go say which are active. In a plane, between periodic walls and beside kinematic particles a GPU
  /// evaluates the network alone, and also that of obstacle particles where obstacles move. Particles that come or go
  /// within a bundle on a GPU take part in the corrections from the next one on, or until its end.
  Trajectory rollout(const Scene& scene, const Environment& environment, const std::vector<int32_t>& particle_type,
                     const std::vector<std::vector<Vec3f>>& start, const RolloutOptions& options) const;

  /// A scene of rollout_many() and what rollout() takes. All that is pointed to must live until its result is there.
  struct SceneRollout {
    std::string name;  ///< in errors
    const Scene* scene = nullptr;
    const Environment* environment = nullptr;
    const std::vector<int32_t>* particle_type = nullptr;     ///< [n]
    const std::vector<std::vector<Vec3f>>* start = nullptr;  ///< [history + 1 or more][n] positions [m], newest last
    RolloutOptions options = {};
  };
  struct SceneResult {
    std::size_t scene;  ///< its place in the list
    Trajectory trajectory;
    std::string alone;  ///< why it ran alone; empty: together with others on a GPU
  };
  static constexpr int64_t batch_scenes = 64;
  struct ManyOptions {
    int64_t most_at_once = batch_scenes;  ///< scenes that a GPU runs together
    /// Frames so far of the scenes that are being run, up to and with their last one. What it throws ends all.
    std::function<void(int64_t frame)> progress = {};
  };
  /// Of the scenes that ran together.
  struct ManyCost {
    int64_t frames = 0;  ///< of all scenes
    double seconds = 0;  ///< on the GPU, without what starts, recordings of launches and copies of results take
  };
  /// The rollouts of all scenes, each with the bits that rollout() gives it. `done` takes each result on the calling
  /// thread: batch by batch, in the order of the list within each, then those of scenes that run alone; results of a
  /// batch when the next one has run, or not where that throws. At most 2^27 positions of frames are in memory at
  /// once: of longer rollouts fewer scenes run together. On a GPU scenes run together where the network is an HGN that
  /// aggregates activations, nothing of them changes, they have particles, equally many frames and the same lower
  /// corner of the domain; the others run one after the other, as all do on a CPU. A scene that diverges stops alone.
  /// Checks all scenes first: throws as rollout(). Errors begin with the scene's place in the list and its name, or
  /// with the first and the last of those that ran together. Another call may follow one that has thrown.
  ManyCost rollout_many(const std::vector<SceneRollout>& scenes, const std::function<void(SceneResult&&)>& done,
                        const ManyOptions& options) const;

 private:
  /// Checks a scene of rollout_many(). Why it runs alone; "" where it may run with others.
  std::string why_alone(const SceneRollout& scene) const;
  /// Trajectories of a batch of scenes are made while the next one runs.
  void rollout_batches(const std::vector<SceneRollout>& scenes, const std::vector<std::vector<std::size_t>>& batches,
                       const std::function<void(SceneResult&&)>& done, const ManyOptions& options,
                       ManyCost& cost) const;
  void run_batch(const std::vector<SceneRollout>& scenes, const std::vector<std::size_t>& batch,
                 const ManyOptions& options) const;
  /// Accelerations of the next config().bundle frames [bundle][n].
  std::vector<std::vector<Vec3f>> predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                                          const std::vector<int32_t>& material,
                                          const std::vector<std::vector<Vec3f>>& positions, Device device,
                                          FrameTiming& timing) const;
  /// What the network sees of the particles' materials; empty where it does not.
  std::vector<int32_t> seen_materials(const Environment& environment, const std::vector<int32_t>& particle_type,
                                      const std::vector<int32_t>& material) const;
  CudaSimulator& gpu_simulator() const;
  Trajectory rollout_on_gpu(const Scene& scene, const Environment& environment,
                            const std::vector<int32_t>& particle_type, const std::vector<int32_t>& material,
                            const std::vector<std::vector<Vec3f>>& start, const RolloutOptions& options) const;
  /// Of scenes in which obstacles move or particles come and go.
  Trajectory rollout_changing_on_gpu(const Scene& scene, const Environment& environment,
                                     const std::vector<int32_t>& particle_type, const std::vector<int32_t>& material,
                                     const std::vector<std::vector<Vec3f>>& start, const RolloutOptions& options,
                                     ParticleLifecycle& lifecycle) const;

  std::shared_ptr<const Network> network_;
  std::shared_ptr<const nn::Weights> weights_;
  mutable std::shared_ptr<CudaSimulator> on_gpu_;  ///< made when first asked for
  mutable std::shared_ptr<CudaBatch> batch_;       ///< the same
};

/// History of `frames` positions ending at the scene's start, extrapolated ballistically backwards: particle i was at
/// x - v k dt + g (k dt)^2 / 2 k frames before. Frame differences then grow by g dt^2 a frame, and so does the next one
/// in free flight, x + v dt + g dt^2 / 2: the acceleration to predict is g dt^2 from the first frame on. Used in
/// rollouts and in training alike. Particles that are `kinematic` ([n]; empty: none) do not fall.
std::vector<std::vector<Vec3f>> start_history(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                                              const Vec3d& gravity, double frame_time, int frames,
                                              const std::vector<uint8_t>& kinematic = {});

}  // namespace graupel::graph
