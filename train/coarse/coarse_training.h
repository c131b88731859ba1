// Trains the constants of coarse MPM (hybrid/coarse_model.h) by compass search (Kolda, Lewis and Torczon 2003): each
// constant in turn is made larger and smaller, and kept where runs of all training scenes to the end of the horizon get
// better. What is judged is the rollout itself; no gradient passes through the solver.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "train/coarse/coarse_scenes.h"

namespace graupel::train {

struct CoarseTrainingOptions {
  CategoryRecipe recipe;
  Device target = Device::cpu;  ///< where runs of the model have to cost no more than MPM on 2 dx
  int64_t scenes = 96;          ///< drawn of the split train
  int64_t valid_scenes = 48;    ///< drawn of the split valid, for the choice among generations
  double minutes = 1e9;         ///< stop after this wall time
  int64_t sweeps = 3;           ///< through all constants, each with half the step of the one before
  double first_step = 0.7;      ///< of offsets, in ln
  int64_t frames = 120;
  uint64_t seed = 0;
  Device device = Device::cpu;
  /// Where the search begins, with its own steps; nothing: at softened water and sand, with fitted steps.
  std::optional<hybrid::CoarseModel> from = {};
  std::map<std::string, std::string> provenance;
  std::function<void(const std::string&)> message = [](const std::string&) {};
  /// Called with the model that the search begins with, and with each that is better on split valid.
  std::function<void(const hybrid::CoarseModel&)> improved = [](const hybrid::CoarseModel&) {};
  std::function<bool()> should_stop = [] { return false; };
};

/// ln of a model's error over the opponent's, max(error - floor, floor / 10) each, within -4 and 4: the mean of
/// position and density. A diverged run counts as 4.
double log_ratio(const RunErrors& run, const CoarseScene& scene);

/// Mean of log_ratio, and four times the mean ln of the predicted time over that of MPM on 2 dx at its largest step,
/// where that is positive.
double coarse_cost(const hybrid::CoarseModel& model, const std::vector<RunErrors>& errors,
                   const std::vector<const CoarseScene*>& scenes, Device target);

/// A model on the scenes of split valid.
struct Judgement {
  double cost = 0;                             ///< coarse_cost
  double position = 0, density = 0, time = 0;  ///< over MPM's on 2 dx at its largest step, geometric means
};

struct CoarseTrainingResult {
  hybrid::CoarseModel model;
  int64_t sweeps = 0;
  double seconds = 0;       ///< of the search, with the runs that it begins with
  double data_seconds = 0;  ///< of the scenes' runs of MPM and their largest steps
  std::size_t train_scenes = 0, valid_scenes = 0;
  Judgement before, after;
};

/// Begins with steps fitted to those of the largest-step search and with softened water and sand; of the models after
/// each sweep the best on split valid is returned. Throws ConfigError where the recipe gives no scenes to train on.
CoarseTrainingResult train_coarse(const CoarseTrainingOptions& options);

}  // namespace graupel::train
