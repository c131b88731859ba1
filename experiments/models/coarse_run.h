// Runs MPM on a coarse grid with trained constants (hybrid/coarse_model.h) on a scene.
#pragma once

#include <string>

#include "experiments/models/mpm_run.h"
#include "hybrid/coarse_model.h"

namespace graupel::experiments {

hybrid::CoarseModel read_coarse_model(const std::string& file);

/// Places and cost of the truth's particles, options.tracers, or of the model's own. A run that blows up is repeated
/// with half as many substeps again, up to eight times the model's; what it took counts as search.
TimedRun run_coarse_model(const hybrid::CoarseModel& model, const Scene& scene, MpmRunOptions options);

}  // namespace graupel::experiments
