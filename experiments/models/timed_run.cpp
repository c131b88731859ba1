#include "experiments/models/timed_run.h"

#include <algorithm>
#include <filesystem>

namespace graupel::experiments {

compare::RunCost cost_with_weights(const TimedRun& timed, const std::string& weights) {
  compare::RunCost cost = timed.cost;
  for (const ParticleFrame& frame : timed.run.trajectory.frames)
    cost.kept_bytes += static_cast<double>(frame.position.size() * sizeof(Vec3f) + frame.active.size());
  if (!weights.empty()) cost.weights_bytes = static_cast<double>(std::filesystem::file_size(weights));
  return cost;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace graupel::experiments
