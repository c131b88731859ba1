// Answers to a parameter sweep that need no model: nothing moves; the training run whose parameters are nearest;
// for one parameter, the line between the two training runs on either side. A model that does not beat them is of no
// use.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/metrics/displacement_error.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::bench {

/// Training runs that stand for other parameters: (1 - fraction) first + fraction second.
struct TrainingPair {
  int first = 0, second = 0;
  double fraction = 0;
};
/// Nearest of `runs` [runs][parameters], every parameter over its range.
TrainingPair nearest_run(const std::vector<std::vector<double>>& runs, const std::vector<double>& parameters);
/// The runs on either side; none for several parameters, and outside of the runs.
std::optional<TrainingPair> runs_beside(const std::vector<std::vector<double>>& runs,
                                        const std::vector<double>& parameters);

struct BaselineErrors {
  double delta = 0, displacement_relative = 0;
};
struct Baselines {
  BaselineErrors nothing_moves, nearest;
  std::optional<BaselineErrors> linear;
};

/// Of run `i` of a split against its truth, over the frames that the training runs have too. Throws InputError when
/// these have other particles.
Baselines baselines_of_run(const io::TrajectoryReader& train, const io::TrajectoryReader& split, int i);

}  // namespace graupel::bench
