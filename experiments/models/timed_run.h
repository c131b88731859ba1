// A model's run with its cost, and the median that all of them share.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "compare/comparison.h"
#include "compare/metrics/evaluation.h"
#include "compare/metrics/particle_run.h"

namespace graupel::experiments {

/// A run with all its frames (the last usable one repeated after a divergence) and its cost.
struct TimedRun {
  compare::ParticleRun run;
  compare::RunCost cost;
  std::size_t moved = 0;  ///< particles that the model moves; those of the run, but where it carries tracers
  std::optional<compare::TrustResult> trust = {};  ///< of reduced-order models
  compare::ContactForces forces = {};              ///< of runs of MPM that were asked for them
};

/// The run's cost, with the frames that the comparison keeps and the weights file, if there is one.
compare::RunCost cost_with_weights(const TimedRun& timed, const std::string& weights);

/// The upper one of the two in the middle; 0 of none.
double median(std::vector<double> values);

}  // namespace graupel::experiments
