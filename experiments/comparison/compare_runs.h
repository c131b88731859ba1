// Compares models on scenes: runs them, evaluates them against the truth, writes the files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"

namespace graupel::experiments {

/// A reduced-order model is for one scene: what becomes of the others.
enum class OtherScenes { refuse, leave_out };

struct CompareOptions {
  /// Scene files, folders of them, data sets (.h5, or their folders) and recipes. "8" among them takes the
  /// first 8 scenes of each recipe and data set, "8:16" those from 8 to 15.
  std::vector<std::string> scenes;
  std::string training_runs;        ///< data set of the reduced-order models, for baselines; empty: none
  std::string split;                ///< of recipes and data sets' folders: train, valid or test
  std::vector<std::string> models;  ///< mpm, mpm:fast, mpm:coarse, weights files
  int64_t frames = 0;               ///< 0: the scene's
  int64_t one_step_stride = 5;      ///< every how many frames the one-step error is taken
  double density_limit = 1;         ///< of networks' rollouts, of the density at rest; 0: none
  bool free_flight = true;          ///< of networks' rollouts: what flies keeps its momentum
  bool forces = false;              ///< record those of runs of MPM on obstacles and walls, by runs of their own
  std::vector<std::string> set;     ///< scene keys, "key=value"
  std::optional<uint64_t> seed;     ///< of the particle sampling; default the scene's; of a recipe's draws, default 0
  std::string device = "auto";      ///< of MPM
  int threads = 0;
  OtherScenes other_scenes = OtherScenes::refuse;
  bool one_step_only = false;  ///< no rollouts: one-step errors alone
  bool floors = true;          ///< chaos floors: two more MPM runs a scene
  std::string floor_file;      ///< read them from this file instead
  std::string json, csv, report, write_floors;
  std::string pictures;  ///< folder for contact sheets, one a scene and model
  std::string command;   ///< that the report names
};

/// Runs and evaluates everything; writes no file. Throws ConfigError (an unknown model, no scene, no model, a
/// reduced-order model with a scene that it is not for), InputError, and DivergedError, naming the scene, when a truth
/// itself diverges.
compare::Comparison make_comparison(const CompareOptions& options);

/// make_comparison, then the table on the terminal, and --json, --csv, --report, --pictures, whose folders are checked
/// first (IoError). When a truth diverges, the scenes before it are written before the error is thrown.
void run_compare(const CompareOptions& options);

}  // namespace graupel::experiments
