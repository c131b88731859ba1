#include "experiments/comparison/fairness.h"

#include <algorithm>
#include <cmath>

#include "experiments/process/process.h"

namespace graupel::experiments {

Device common_device(const std::string& word, const std::vector<ModelChoice>& models) {
  const bool learned =
      std::any_of(models.begin(), models.end(), [](const ModelChoice& model) { return model.kind != ModelKind::mpm; });
  return learned && word == "auto" ? Device::cpu : parse_device(word);
}

bool runs_on_all_scenes(ModelKind kind) { return kind != ModelKind::reduced; }

bool judged_by_tracers(const mpm::SolverVariant& variant) { return variant.resolution != 1; }

mpm::SolverVariant opponent_of(const std::vector<ModelChoice>& models) {
  const auto asked_for = [&](const mpm::SolverVariant& variant) {
    return std::any_of(models.begin(), models.end(), [&](const ModelChoice& model) {
      return model.kind == ModelKind::mpm && model.variant == variant;
    });
  };
  const bool coarse_alone = asked_for(mpm::coarse_solver) && !asked_for(mpm::coarse_fast_solver);
  return coarse_alone ? mpm::coarse_solver : mpm::coarse_fast_solver;
}

bool has_one_step_error(ModelKind kind) { return kind == ModelKind::network || kind == ModelKind::reduced; }

std::map<std::string, std::string> verdicts(const compare::MetricValues& model, const compare::MetricValues& opponent,
                                            const compare::MetricValues& floors) {
  std::map<std::string, std::string> verdict;
  for (const std::string key : deciding_metrics) {
    const double difference = model.at(key) - opponent.at(key);
    const auto floor = floors.find("floor_" + key);
    if (std::abs(difference) <= (floor == floors.end() ? 0 : floor->second))
      verdict[key] = "tie";
    else
      verdict[key] = difference > 0 ? "worse" : "better";
  }
  return verdict;
}

bool loses(const std::map<std::string, std::string>& verdicts) {
  return std::count_if(verdicts.begin(), verdicts.end(), [](const auto& v) { return v.second == "worse"; }) >=
         losing_metrics;
}

}  // namespace graupel::experiments
