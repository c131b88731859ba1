// Every metric of the comparison: key, unit and one line of meaning. docs/reference/metrics.md defines them; a test
// holds the two lists equal, and another that every result has every key with a finite value.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace graupel::compare {

using MetricValues = std::map<std::string, double>;

/// Part of the comparison that yields a metric; a part that was switched off leaves its metrics out.
enum class MetricGroup { rollout, one_step, cost, floors, ratios };

struct MetricInfo {
  std::string key;
  std::string unit;     ///< SI, "" for a number
  std::string meaning;  ///< one line
  MetricGroup group = MetricGroup::rollout;
};

/// Metrics of one scene and model.
const std::vector<MetricInfo>& metric_list();
/// Metrics of one material in a scene and model.
const std::vector<MetricInfo>& material_metric_list();

/// Keys of `list` in the wanted groups that `values` lacks or holds as NaN or infinity.
std::vector<std::string> missing_metrics(const std::vector<MetricInfo>& list, const std::vector<MetricGroup>& groups,
                                         const MetricValues& values);

}  // namespace graupel::compare
