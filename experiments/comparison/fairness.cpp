#include "experiments/comparison/fairness.h"

#include <algorithm>
#include <cmath>

#include "core/system/error.h"
#include "experiments/process/process.h"

namespace graupel::experiments {

Device common_device(const std::string& word, const std::vector<ModelChoice>& models) {
  const bool learned =
      std::any_of(models.begin(), models.end(), [](const ModelChoice& model) { return model.kind != ModelKind::mpm; });
  return learned && word == "auto" ? Device::cpu : parse_device(word);
}

bool runs_on_all_scenes(ModelKind kind) { return kind != ModelKind::reduced; }

void check_runs_on(const ModelChoice& model, const Scene& scene) {
  if (model.kind != ModelKind::reduced) return;
  const char* what = scene.domain.is_plane()                 ? "two dimensions (domain.dimensions: 2)"
                     : scene.has_inactive_particles()        ? "particles that come or go (emitters, sinks, open walls)"
                     : scene.domain.has_wall(Wall::periodic) ? "periodic walls"
                                                             : nullptr;
  if (what != nullptr)
    throw ConfigError("'" + model.name + "' cannot run '" + scene.name + "': it has " + what +
                      " (allowed for reduced-order models: none). Compare " + mpm::variant_words() +
                      " or graph networks on it, or use a scene without them");
}

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

compare::MetricValues ratios(const compare::MetricValues& model, const compare::MetricValues& opponent,
                             const compare::MetricValues& floors) {
  constexpr double smallest = 1e-30;  // [ms] of a run that computes nothing
  compare::MetricValues ratios;
  for (const std::string key : compare::deciding_metrics) {
    const double floor = floors.at("floor_" + key);
    const auto beyond = [&](double error) { return std::max(error - floor, floor / 10); };
    ratios["ratio_" + key] = beyond(model.at(key)) / beyond(opponent.at(key));
  }
  if (model.count("frame_ms"))
    ratios["ratio_frame_ms"] = std::max(model.at("frame_ms"), smallest) / std::max(opponent.at("frame_ms"), smallest);
  return ratios;
}

}  // namespace graupel::experiments
