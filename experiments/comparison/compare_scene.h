// One scene of a comparison: its truth, and the evaluation of each model against it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compare/pictures/backdrop.h"
#include "compare/pictures/contact_sheet.h"
#include "compare/report/report.h"
#include "experiments/comparison/baseline_runs.h"
#include "experiments/comparison/compare_runs.h"
#include "experiments/comparison/floor_file.h"
#include "experiments/comparison/scene_tasks.h"
#include "experiments/models/coarse_run.h"
#include "experiments/models/model_choice.h"
#include "experiments/models/mpm_run.h"
#include "experiments/models/network_run.h"
#include "experiments/models/reduced_run.h"
#include "graph/features/features.h"

namespace graupel::experiments {

/// A model with what it needs to run.
struct ComparedModel {
  ModelChoice choice;
  std::shared_ptr<const graph::LearnedSimulator> network;
  std::shared_ptr<const LoadedModel> reduced;
  std::shared_ptr<const hybrid::CoarseModel> coarse;
};

class SceneComparison {
 public:
  /// `training_runs`: of the scene's reduced-order models, for the baselines; may be null.
  SceneComparison(const CompareOptions& options, const SceneTask& task, Device device,
                  const compare::ReportBudget& budget, const TrainingRuns* training_runs = nullptr);
  /// Evaluates the models one after the other, and baselines where one of them is a reduced-order model.
  compare::SceneResult run(const std::vector<ComparedModel>& models);
  /// After run(), where the options ask for them.
  const SceneFloors& floors() const { return floors_; }

 private:
  void make_truth();
  void make_references(const mpm::SolverVariant& opponent);
  /// What every model has to beat; `frame_ms` of what computes nothing is 0.
  void add_rival(const std::string& name, const TimedRun& run, double frame_ms);
  /// MPM against itself: with particles moved a little (position errors), and with another seed (the rest).
  SceneFloors measure_floors();
  /// Remembers that a reference run diverged.
  void note_divergence(const std::string& reference, const TimedRun& run);
  TimedRun run_variant(const mpm::SolverVariant& variant);
  /// The run of a model: one that is there, or `own` once it is made.
  const TimedRun& run_of(const ComparedModel& model, TimedRun& own);
  compare::ModelResult evaluate(const ComparedModel& model);
  /// What must be known of a model in this scene, said on the terminal too.
  void add_remarks(const ComparedModel& model, compare::ModelResult& result);
  /// Metrics, picture and track of a run; `name` stands on the picture.
  void judge(const TimedRun& timed, const compare::RunCost& cost, const std::string& name,
             compare::ModelResult& result);
  void add_baselines();
  const graph::Environment& environment();
  /// Throws ConfigError where the network predicts frames by a gravity that the data do not say.
  compare::OneStepError one_step_of_network(const ComparedModel& model);
  compare::OneStepError one_step_of_rollout(const compare::ParticleRun& run) const;
  std::vector<std::size_t> one_step_frames() const;
  std::vector<Vec3f> true_position(int64_t frame) const;
  std::vector<std::size_t> active_between(std::size_t n) const;
  std::string label(const std::string& what) const { return task_.scene.name + ": " + what; }

  const CompareOptions& options_;
  const SceneTask& task_;
  Device device_;
  compare::ReportBudget budget_;
  const TrainingRuns* training_runs_;
  sparsegrid::ObstacleSet obstacles_;              ///< those that stay where they are
  sparsegrid::ObstacleSet all_obstacles_;          ///< with those that move
  std::optional<graph::Environment> environment_;  ///< for networks; made when one runs
  StartState start_;
  TimedRun truth_;                 ///< its cost is that of mpm, also where the truth was stored
  std::optional<TimedRun> rerun_;  ///< mpm run again where the truth was stored
  mpm::SolverVariant opponent_;
  std::optional<TimedRun> opponent_run_;
  compare::MetricValues opponent_values_;  ///< group rollout, and frame_ms
  SceneFloors floors_;                     ///< none where the options leave them out
  std::optional<compare::Backdrop> backdrop_;
  compare::SceneResult result_;
};

}  // namespace graupel::experiments
