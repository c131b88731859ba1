// Errors of the answers to a parameter sweep that need no model (experiments/models/training_runs.h), on stored runs:
// nothing moves, the nearest training run, and linear interpolation between the training runs around.
#pragma once

#include <optional>

#include "experiments/models/training_runs.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::bench {

struct BaselineErrors {
  double delta = 0, displacement_relative = 0;
};
struct Baselines {
  BaselineErrors nothing_moves, nearest;
  std::optional<BaselineErrors> linear;
};

/// Of run `i` of a split against its truth, over the frames that the training runs have too. Throws InputError when
/// these have other particles.
Baselines baselines_of_run(const experiments::TrainingRuns& train, const io::TrajectoryReader& split, int i);

}  // namespace graupel::bench
