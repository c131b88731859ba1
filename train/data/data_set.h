// Trajectories of a data set as training reads them: positions, types, who is in the run, and each scene's environment.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "graph/features/features.h"
#include "graph/features/particle_schedule.h"
#include "io/trajectory/trajectory_file.h"
#include "train/config/network_config.h"

namespace graupel::train {

/// A scene with what is built of it once.
struct SceneContext {
  explicit SceneContext(Scene read_scene)
      : scene(std::move(read_scene)), environment(graph::check_training_scene(scene)) {}
  Scene scene;
  graph::Environment environment;
  /// Displacement that gravity adds in a frame: g dt^2 [m/frame^2].
  Vec3f gravity_step() const { return environment.gravity_step; }
  /// [s] as rollouts count it.
  double time_of(int64_t frame) const { return static_cast<double>(frame) * scene.frame_time; }
};

/// Frames of a trajectory in which a particle is in the run: [first, end).
struct FramesInRun {
  int32_t first = 0, end = 0;
  bool holds(int64_t from, int64_t to) const { return first <= from && to < end; }
};

/// What a network is told of some particles; of networks that do not see constants the materials are empty.
struct ParticleKinds {
  std::vector<int32_t> type_row, material;
};

struct TrajectoryInfo {
  std::vector<int32_t> type_row;        ///< [n] rows of the embedding table
  std::vector<uint8_t> kinematic;       ///< [n] 1 for kinematic particles, which no loss or error counts; or empty
  std::vector<int32_t> material;        ///< [n] indices into context->environment.materials; or empty, unasked
  std::vector<Vec3f> initial_velocity;  ///< [n] [m/s]
  std::vector<FramesInRun> in_run;      ///< [n]; empty: all particles are always in the run
  graph::ParticleSchedule schedule;     ///< births of the scene's emitters
  int64_t frames = 0;                   ///< usable ones
  double frame_time = 0;                ///< between those that are stored [s]
  bool tells_presence = false;          ///< the file says which particles are in the run
  bool converted = false;               ///< from the data of another program, which may not say gravity (then 0)
  std::shared_ptr<const SceneContext> context;

  bool is_kinematic(std::size_t particle) const { return !kinematic.empty() && kinematic[particle] != 0; }
  int32_t material_of(std::size_t particle) const { return material.empty() ? graph::no_material : material[particle]; }
  int64_t kinematic_count() const { return std::count(kinematic.begin(), kinematic.end(), 1); }
  /// Whether a particle is in the run in all frames `from` .. `to`.
  bool is_in_run(std::size_t particle, int64_t from, int64_t to) const {
    return in_run.empty() || in_run[particle].holds(from, to);
  }
  /// Whether it moves by itself and is in the run in all these frames: a prediction of it counts.
  bool counts(std::size_t particle, int64_t from, int64_t to) const {
    return !is_kinematic(particle) && is_in_run(particle, from, to);
  }
  /// Whether counts() holds for some particle.
  bool some_count(int64_t from, int64_t to) const;
  /// Particles in the run in a frame, ascending.
  std::vector<int32_t> present(int64_t frame) const;
  ParticleKinds kinds(const std::vector<int32_t>& particles) const;
};

class DataSplit;

struct DataSplitOptions {
  double memory_limit = 0;  ///< [bytes] of positions kept; the rest is read when needed; 0: half of the machine's
  int processes = 1;        ///< of this machine that open the file; they share the limit
  int threads = 1;
  bool materials = false;  ///< find the particles' materials, for networks that see their constants
  /// Called when headers and scenes of all trajectories are known, before positions are read: what it throws ends the
  /// opening.
  std::function<void(const DataSplit&)> check;
  std::function<void(const std::string& what, int64_t done, int64_t total)> progress;
};

/// One file of a data set. Immutable once open; may be read from many threads.
class DataSplit {
 public:
  /// Throws InputError when the file is missing, damaged, or a trajectory has no scene, fewer than 3 frames or
  /// particles of an unknown type, does not tell which particles are in the run although its scene lets them come or
  /// go, and as mpm::particle_materials where materials are asked for; ConfigError for scenes that are not trained on.
  explicit DataSplit(const std::string& file, const DataSplitOptions& options = {});

  const std::string& file() const { return file_; }
  int count() const { return static_cast<int>(info_.size()); }
  const TrajectoryInfo& trajectory(int i) const { return info_[static_cast<std::size_t>(i)]; }
  bool has_materials() const { return has_materials_; }
  /// Recorded attribute of the data set, "" when absent (e.g. "recipe", "seed").
  std::string attribute(const std::string& name) const;
  /// The scene of a trajectory, as it is stored.
  const std::string& scene_json(int i) const { return scene_json_[static_cast<std::size_t>(i)]; }

  /// Fingerprint of the split: scenes, lengths, numbers of particles, and the first positions.
  std::string hash() const;

  /// Positions of frames [first, first + count), [count][n] [m].
  std::vector<std::vector<Vec3f>> positions(int i, int64_t first, int64_t count) const;
  /// history + 1 positions [n] ending at `frame`, newest last. Frames before the first are those that a rollout starts
  /// with (graph::start_history), those before a birth those that a rollout gives (graph::add_past_of_born).
  std::vector<std::vector<Vec3f>> history(int i, int64_t frame, int64_t history) const;

  /// Means and standard deviations of v^t = x^t - x^{t-1} and v^{t+1} - v^t over all particles and frames, sums in
  /// f64; the training noise enters in quadrature. Kinematic particles and those that are not in the run do not count,
  /// and nothing varies along z in the plane.
  graph::Normalization statistics(double noise_std, int threads) const;

  /// Throws ConfigError when the data were made with another frame time, cell size or number of dimensions than the
  /// network is for, or with obstacles that it cannot see. `weights`: the file whose settings these are, "" for a run's
  /// own.
  void check_fits(const NetworkConfig& config, const std::string& weights = "") const;
  /// That draw_sample() finds a sample in every trajectory: a target of `bundle` frames after as many bundles of the
  /// network's own as push_steps says. Throws ConfigError for a trajectory that is too short, InputError for one in
  /// which no particle counts in so many frames.
  void check_samples(int64_t bundle, int64_t push_steps) const;

 private:
  void read_headers(const DataSplitOptions& options);
  void build_contexts(const DataSplitOptions& options);
  void find_materials(const DataSplitOptions& options);
  void find_births(const DataSplitOptions& options);
  void load_positions(const DataSplitOptions& options);

  std::string file_;
  bool has_materials_ = false;
  std::unique_ptr<io::TrajectoryReader> reader_;
  std::vector<TrajectoryInfo> info_;
  std::vector<std::string> scene_json_;
  std::vector<std::vector<Vec3f>> resident_;  ///< [trajectory][frames * n]; empty where it did not fit
};

}  // namespace graupel::train
