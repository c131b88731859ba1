// Runs one model on one scene and measures what it costs: MPM and its cheaper variants, graph networks and
// reduced-order models.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "compare/metrics/evaluation.h"
#include "compare/metrics/particle_run.h"
#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "experiments/models/reduced_runs.h"
#include "graph/learned_simulator.h"
#include "mpm/scene_variants.h"

namespace graupel::experiments {

enum class ModelKind { mpm, network, reduced };

/// A network with the laws that its rollouts are held to, or one of the two alone.
enum class NetworkParts { all, network_alone, corrections_alone };

/// What a word of --models means.
struct ModelChoice {
  std::string name;  ///< as given
  ModelKind kind = ModelKind::mpm;
  mpm::SolverVariant variant = {};
  std::string label = "";    ///< short, and unlike those of the other models
  std::string weights = "";  ///< file; empty for MPM, and for corrections-only until it has a network's settings
  NetworkParts parts = NetworkParts::all;
};
/// "mpm", "mpm:...", a weights file, "WEIGHTS:no-corrections", "WEIGHTS:corrections-only", or "corrections-only".
/// Throws ConfigError for an unknown "mpm:..." word and for parts of a reduced-order model, InputError for a weights
/// file that cannot be read.
ModelChoice parse_model(const std::string& word);

/// Particles at the start of a scene, with the mass and volume of each.
struct StartState {
  std::vector<int32_t> particle_type;
  std::vector<Vec3f> position;       ///< [m]
  std::vector<Vec3f> velocity;       ///< [m/s]
  std::vector<double> mass, volume;  ///< [kg], [m^3]
};
StartState start_of(const Scene& scene, uint64_t seed);

/// The scene with its particles as points, each moved by `distance` [m] in a random direction, but not beyond the
/// walls.
Scene moved_scene(const Scene& scene, uint64_t seed, double distance);

/// The scene with its particles as points at `position` [particles], at rest: a late state, without its stresses.
Scene resting_scene(const Scene& scene, uint64_t seed, const std::vector<Vec3f>& position);

/// A run with all its frames (the last usable one repeated after a divergence) and its cost.
struct TimedRun {
  compare::ParticleRun run;
  compare::RunCost cost;
  std::size_t moved = 0;  ///< particles that the model moves; those of the run, but where it carries tracers
};

struct MpmRunOptions {
  mpm::SolverVariant variant = {};
  Device device = Device::cpu;
  uint64_t seed = 0;
  int64_t frames = 0;
  std::string label;  ///< of the progress line
  /// Particles whose places the run tells instead of its own: on another grid it carries them as tracers, so that it is
  /// judged on the truth's particles. Not owned; null: its own.
  const StartState* tracers = nullptr;
  bool must_finish = false;  ///< throw DivergedError instead of returning the frames before it (the truth)
};
TimedRun run_mpm(const Scene& scene, const MpmRunOptions& options);

/// Laws that rollouts of networks are held to, as in LearnedSimulator::RolloutOptions.
struct HeldLaws {
  double density_limit = 1;
  bool free_flight = true;
  bool project = true;
  bool network = true;
};
/// Those of a rollout with some of its parts, from those of the whole: without corrections particles are not moved out
/// of obstacles and walls either.
HeldLaws laws_of(NetworkParts parts, HeldLaws whole);
/// The same for a learned simulator, from frame 0 with a ballistic past.
TimedRun run_network(const graph::LearnedSimulator& simulator, const Scene& scene,
                     const graph::Surroundings& surroundings, const StartState& start, int64_t frames, Device device,
                     const std::string& label, const HeldLaws& laws = {});

/// The same for a reduced-order model, from the start of the scene. Frame 0 is the nearest state that the model knows.
TimedRun run_reduced(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t frames, Device device,
                     const std::string& label);

/// Resident memory of the process while this object lives [bytes].
class MemoryMeter {
 public:
  MemoryMeter();  ///< resets the kernel's peak
  double peak() const;
  double added() const;

 private:
  double before_;
};

/// What a run takes of a GPU's memory [bytes]; 0 on the CPU. Other processes on that GPU would be counted, too.
class DeviceMemoryMeter {
 public:
  explicit DeviceMemoryMeter(Device device);
  void look();  ///< at what the run holds now
  double taken() const { return taken_; }

 private:
  Device device_;
  double free_before_ = 0, taken_ = 0;
};

}  // namespace graupel::experiments
