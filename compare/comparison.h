// The result of a comparison: every scene with every model, and what tables, files and the report show of them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "compare/metrics/evaluation.h"
#include "compare/metrics/metric_list.h"
#include "compare/pictures/player_track.h"
#include "core/scene/contact_force.h"

namespace graupel::compare {

/// What a row of a comparison is.
enum class ModelRole {
  mpm,      ///< full order, and its fast and coarse forms
  learned,  ///< graph networks, corrections alone, coarse MPM with trained constants
  reduced,  ///< reduced-order models
  baseline  ///< what needs no model (nothing-moves, nearest-run, between-runs, beyond-runs)
};
const char* name_of(ModelRole role);

/// How a reduced-order model judges its own run, without the truth (rom/solver/error_indicator.h).
struct TrustResult {
  std::string verdict;               ///< "ok", "doubtful", "do not trust" or "unknown"
  double number = 0;                 ///< indicators over their usual values
  double training_error = 0;         ///< largest displacement-relative error of rolled-out training runs
  std::optional<double> bound = {};  ///< on the run's own displacement-relative error; it decides where there is one
};

/// What the matter of a run did to obstacles and walls.
struct ContactForces {
  std::vector<std::string> names;                 ///< contact_names() of the scene; empty: not known
  std::vector<std::vector<ContactForce>> frames;  ///< [frames + 1, names]
};

struct ModelResult {
  std::string model;  ///< as given: "mpm", "mpm:coarse" or a weights file
  ModelRole role = ModelRole::mpm;
  MetricValues values;
  std::map<std::string, MetricValues> materials;
  ErrorCurves curves;
  std::optional<TrustResult> trust;  ///< of reduced-order models
  double manifold_pull = 0;  ///< share of the way to the training runs that each step of a reduced-order model takes
  std::string note;          ///< what the row stands for: the training runs of a baseline
  int64_t diverged_at_frame = -1;  ///< first frame that is not usable; -1 for none
  std::string one_step_source;     ///< "true history" or "own rollout"; empty: no one-step error
  /// "better", "worse" or "tie" (within the chaos floor) than the scene's opponent, by metric.
  std::map<std::string, std::string> against_opponent;
  std::vector<std::string> remarks;  ///< what a reader must know of this run, a sentence each
  std::string picture;               ///< PNG of the picture row; may be empty
  PlayerTrack track;
  ContactForces forces;  ///< of runs of MPM, where they are recorded
};

/// A run that costs next to nothing, which every model has to beat.
struct RivalRun {
  std::string name;     ///< "mpm:coarse:fast", "nothing-moves"
  MetricValues values;  ///< group rollout; frame_ms, 0 for what computes nothing
  ErrorCurves curves;
};

struct SceneResult {
  std::string name, source;  ///< source: file, and number of the trajectory in a data set
  std::string category;      ///< of a recipe of categories; empty for none
  std::size_t particles = 0;
  std::size_t frames = 0;  ///< predicted frames
  double frame_time = 0;   ///< [s]
  double dx = 0;           ///< [m]
  Vec3d low, size;         ///< domain [m]
  Vec3d up;
  std::vector<double> true_energy;     ///< kinetic energy of the truth [J], entry k is frame k + 1
  std::vector<double> floor_position;  ///< position error curve of MPM with moved particles; empty without floors
  std::vector<double> floor_density;   ///< density error curve of MPM with another seed
  std::string opponent;                ///< solver variant that models lose to: "mpm:coarse:fast" or "mpm:coarse"
  double mpm_frame_ms = 0, opponent_frame_ms = 0;  ///< frame_ms of mpm and of the opponent, whether compared or not
  /// First unusable frame of the runs that all models are held against, where one diverged: the opponent, "moved" and
  /// "reseeded" (the chaos floors).
  std::map<std::string, int64_t> diverged_references;
  std::vector<RivalRun> rivals;  ///< the opponent and nothing-moves, whether compared or not
  bool stored_truth = false;     ///< the truth is of a file; else it is the run of mpm
  std::string picture;           ///< PNG of the truth's picture row
  ContactForces true_forces;     ///< of a truth whose file keeps them, or that recorded them
  PlayerTrack truth;
  PlayerObstacles obstacles;
  std::vector<ModelResult> models;
};

/// What a model took before its first rollout, as its weights tell.
struct OfflineTime {
  std::optional<double> data, training;  ///< [s]; nothing: not told
  std::vector<std::string> devices;      ///< hardware that what is told was timed on, each once
};

struct Comparison {
  std::string command;  ///< that makes it
  std::string version;
  std::string machine;   ///< processor, device
  std::string hardware;  ///< that all runs are timed on: "NVIDIA H200", "2 threads of AMD EPYC"
  int threads = 1;
  std::vector<MetricGroup> groups;  ///< parts that were computed
  std::vector<SceneResult> scenes;
  std::string training_runs;                   ///< data set of the baselines; empty: none was named
  std::map<std::string, OfflineTime> offline;  ///< of models that are made from data, by name
};

/// Mean of every metric of a model over the scenes that it is run on, but of ratios; loses_to_coarse becomes the share
/// of scenes.
MetricValues mean_over_scenes(const Comparison& comparison, const std::string& model);
/// The geometric mean, of the metrics that are positive in all of them: not ruled by the scene with the largest error.
/// Deciding errors of models but the truth count as their resolution at least. With a category, over the scenes of that
/// one.
MetricValues geometric_mean_over_scenes(const Comparison& comparison, const std::string& model,
                                        const std::string& category = "");
/// Categories of the scenes, in the order in which they come first, and the number of scenes of one.
std::vector<std::string> categories_of(const Comparison& comparison);
std::size_t scenes_of_category(const Comparison& comparison, const std::string& category);
/// Who wins what over the opponent, by geometric means of the ratios over all scenes, in a sentence; empty without
/// ratios, and where nothing but `mpm`, the opponent and baselines was compared.
std::string headline(const Comparison& comparison);
/// Metrics in which a model ties with the opponent: "tie in sinkhorn, density_error"; empty for none.
std::string mark_of_ties(const ModelResult& result);
/// Models of any scene, in the order in which they come first.
std::vector<std::string> models_of(const Comparison& comparison);

/// "1 of 3 scenes" for a model that is not run on all of them, else empty.
std::string mark_of_missing_scenes(const Comparison& comparison, const std::string& model);

bool computed(const Comparison& comparison, MetricGroup group);
/// Whether a row is the truth itself: mpm, where no file gave the truth.
bool is_truth(const SceneResult& scene, const ModelResult& result);
/// A scene's chaos floors under the names of the metrics that they bound; empty where they were not computed.
MetricValues floors_of(const SceneResult& scene);
/// What must not be overlooked about the scene's reference runs: "mpm:coarse diverged at frame 7"; empty for most.
std::string mark_of_references(const SceneResult& scene);
/// Short name of a model: "mpm", or a weights file with as few of its folders as tell it from the other models.
std::string short_name(const std::string& model, const std::vector<std::string>& models);

/// "metric of model in scene" for every value that is missing or not finite.
std::vector<std::string> incomplete_results(const Comparison& comparison);

}  // namespace graupel::compare
