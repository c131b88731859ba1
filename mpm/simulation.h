// Runs a scene with the explicit material point method, frame by frame.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/parallel/instruction_set.h"
#include "core/scene/contact_force.h"
#include "core/scene/particle_quantity.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "mpm/sampling.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::mpm {

enum class Precision { f32, f64 };
/// The tuned kernels, or their portable twins, against which they are tested.
enum class Kernels { tuned, portable };

struct SimulationOptions {
  Device device = Device::cpu;
  Precision precision = Precision::f32;
  uint64_t seed = 0;  ///< of the particle sampling
  Kernels kernels = Kernels::tuned;
  /// Of the tuned kernels for the CPU; else instruction_set().
  std::optional<InstructionSet> instruction_set = {};
  /// Keep count of Simulation::contact_forces(); on a GPU the portable kernels then run.
  bool contact_forces = false;
};

/// Conserved and watched quantities [SI]; sums in f64.
struct Diagnostics {
  double mass = 0;
  Vec3d momentum = {0, 0, 0};
  Vec3d angular_momentum = {0, 0, 0};  ///< about the world origin, affine part included
  double kinetic_energy = 0, elastic_energy = 0, potential_energy = 0;
};

/// What the run did so far.
struct RunStatistics {
  int64_t substeps = 0;
  double last_step = 0;                   ///< [s]
  int64_t pushed_out = 0;                 ///< particle-substeps that the obstacle projection moved
  Vec3d pushed_out_momentum = {0, 0, 0};  ///< momentum that this took [kg m/s]
  int64_t born = 0, removed = 0;          ///< particles that emitters sent out, and that sinks and open walls took
  Vec3d scripted_momentum = {0, 0, 0};    ///< that scripts gave to the particles they lead [kg m/s]
  Vec3d load_momentum = {0, 0, 0};        ///< that loads gave to their carriers [kg m/s]
  int64_t loads_without_carriers = 0;     ///< that began where nothing was that can move
  double sound_courant = 0;               ///< largest c dt / dx seen
  double share_over_courant = 0;          ///< largest share of particles with c dt / dx > 1 in a frame's last substep
  int64_t active_blocks = 0, peak_bytes = 0;
  double solver_seconds = 0;  ///< wall time inside advance_frame
};

/// Facts before a run, for --dry-run.
struct Estimate {
  int64_t particles = 0;
  int64_t grid_nodes = 0;  ///< of the active blocks at the start
  int64_t substeps = 0;    ///< whole run, from the first step size
  int64_t memory_bytes = 0;
};

/// A scene with its particles and obstacles, made on the host: what a run starts from. Several threads may each prepare
/// one.
struct PreparedScene {
  /// Samples the sources and builds the obstacles. Throws ConfigError when a source lies inside an obstacle or outside
  /// the walls (naming both), makes no particle, or is led out of the walls by its script.
  PreparedScene(const Scene& scene, const SimulationOptions& options);

  Scene scene;
  SimulationOptions options;
  sparsegrid::ObstacleSet obstacles;
  SampledParticles particles;
};

class Simulation {
 public:
  /// Throws ConfigError when a fixed step is too long for the speed of a scripted body.
  static std::unique_ptr<Simulation> create(const PreparedScene& prepared);
  /// The same, after PreparedScene(scene, options).
  static std::unique_ptr<Simulation> create(const Scene& scene, const SimulationOptions& options);
  virtual ~Simulation() = default;

  virtual std::size_t particle_count() const = 0;
  virtual const std::vector<int32_t>& particle_type() const = 0;  ///< [n], in the order of frame()
  virtual const sparsegrid::ObstacleSet& obstacles() const = 0;
  virtual double time() const = 0;  ///< [s]

  /// One frame of scene.frame_time. Throws DivergedError (particle, material, step, suggested step) on NaN, det F <= 0
  /// or a particle that moves over one cell in a substep; the state is then that of the bad substep.
  virtual void advance_frame() = 0;
  /// One substep of the frame; true once the frame is done. Frames made of these have the bytes of advance_frame().
  /// The tuned kernels for GPUs take the whole frame at once.
  virtual bool advance_substep() {
    advance_frame();
    return true;
  }
  /// Positions and velocities in source order, whatever the solver's own order; those that are not in the run at their
  /// place of birth, or where they left.
  virtual ParticleFrame frame() const = 0;
  /// The `wanted` fields of the same state in the same order; no stress and no affine velocity where a particle is not
  /// in the run.
  virtual ParticleFields fields(FieldSet wanted) const = 0;
  /// The same numbers of one quantity, [particle_count(), components_of(what)], in the memory of the run's device.
  virtual std::shared_ptr<const float> rows(ParticleQuantity what) const = 0;
  virtual Diagnostics diagnostics() const = 0;
  virtual RunStatistics statistics() const = 0;
  /// What the matter did to each obstacle and wall in the frame before (inside of a frame: since its start, or since
  /// load_state()), in the order of contact_names(scene); empty unless SimulationOptions::contact_forces.
  virtual std::vector<ContactForce> contact_forces() const { return {}; }

  /// Carries massless points along with the grid's velocity (mpm/solver/tracers.h), from their positions [m] and
  /// velocities [m/s] now, or, where times of birth are given, from then on [s]. They leave the run where particles do,
  /// change nothing of it and are no part of its saved state. All [tracers]; no times of birth: all are there now.
  /// Throws ConfigError for lists of other lengths, and for the tuned kernels for GPUs.
  virtual void carry_tracers(const std::vector<Vec3f>& position, const std::vector<Vec3f>& velocity,
                             const std::vector<double>& birth_time = {});
  /// Positions now [m], in the given order; of those that are not in the run as in frame().
  virtual std::vector<Vec3f> tracers() const { return {}; }
  /// [tracers] 0 for those that are not in the run (yet, any more); empty: all always are.
  virtual std::vector<uint8_t> active_tracers() const { return {}; }
  virtual double tracer_seconds() const { return 0; }  ///< wall time inside advance_frame that they took (CPU)

  /// Whole state between two frames, bit for bit: a restored run goes on exactly as if it had not stopped.
  virtual std::vector<std::byte> save_state() const = 0;
  /// Throws InputError when the state belongs to another scene, seed, precision, kind of device or version, or is
  /// damaged.
  virtual void load_state(const std::vector<std::byte>& state) = 0;
};

/// Many scenes that advance together; each moves as it would alone, to the byte. On a GPU one launch advances all
/// scenes of one grid of which the tuned kernels know all; grids take turns, and the other scenes run one after
/// another. On the CPU each thread advances scenes of its own.
class SceneBatch {
 public:
  /// All scenes must have the same options but for the seed. Throws as Simulation::create does.
  static std::unique_ptr<SceneBatch> create(const std::vector<PreparedScene>& scenes);
  virtual ~SceneBatch() = default;

  virtual int scene_count() const = 0;
  /// Types of a scene's particles, in the order of frames().
  virtual const std::vector<int32_t>& particle_type(int scene) const = 0;
  /// One frame of every scene that has not diverged. It ends early, and returns false, once `stop` is true, which is
  /// asked between two substeps on the threads that make them (the tuned kernels for GPUs do not ask); the next call
  /// goes on with that frame.
  virtual bool advance_frame(const std::function<bool()>& stop) = 0;
  void advance_frame() {
    advance_frame([] { return false; });
  }
  /// Why a scene has diverged, in the words of Simulation::advance_frame's DivergedError; nothing while it has not.
  virtual std::optional<std::string> divergence(int scene) const = 0;
  /// Of each scene, as Simulation::frame() with the `wanted` fields in it. That of a diverged scene is of no use.
  virtual std::vector<ParticleFrame> frames(FieldSet wanted) const = 0;
  /// Of each scene, as Simulation::rows().
  virtual std::vector<std::shared_ptr<const float>> rows(ParticleQuantity what) const = 0;
  /// Of all scenes together: active_blocks, peak_bytes, loads_without_carriers, solver_seconds, and substeps (the most
  /// of any scene).
  virtual RunStatistics statistics() const = 0;

  int64_t particle_count() const;  ///< of all scenes
};

Estimate estimate(const Scene& scene, const SimulationOptions& options);

/// The scene at 2 dx and an eighth of the particles (a quarter in the plane).
Scene coarse_variant(const Scene& scene);

/// frame() with the `wanted` fields in it.
ParticleFrame frame_with_fields(const Simulation& simulation, FieldSet wanted);

}  // namespace graupel::mpm
