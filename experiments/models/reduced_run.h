// Runs a reduced-order model on a scene and measures what that costs.
#pragma once

#include <cstdint>
#include <string>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "experiments/models/model_choice.h"
#include "experiments/models/reduced_model.h"
#include "experiments/models/timed_run.h"

namespace graupel::experiments {

/// From the start of the scene. Frame 0 is the nearest state that the model knows. `pull`: none takes no step towards
/// the training runs.
TimedRun run_reduced(const LoadedModel& model, const Scene& scene, uint64_t seed, int64_t frames, Device device,
                     Pull pull, const std::string& label);

}  // namespace graupel::experiments
