#include "compare/deciding_metrics.h"

#include <algorithm>
#include <cmath>

namespace graupel::compare {

namespace {

bool most_are(const std::map<std::string, std::string>& verdicts, const char* word) {
  return std::count_if(verdicts.begin(), verdicts.end(), [&](const auto& v) { return v.second == word; }) >=
         losing_metrics;
}

}  // namespace

MetricValues resolution(double dx) {
  const double shift = resolved_shift * dx;
  return {{"position_mse_all", shift * shift}, {"sinkhorn", shift * shift}, {"density_error", resolved_shift}};
}

MetricValues deciding_floors(const MetricValues& measured, double dx) {
  MetricValues floors;
  for (const auto& [key, least] : resolution(dx)) {
    const auto floor = measured.find("floor_" + key);
    floors["floor_" + key] = floor == measured.end() ? least : std::max(floor->second, least);
  }
  return floors;
}

std::map<std::string, std::string> verdicts(const MetricValues& model, const MetricValues& opponent,
                                            const MetricValues& floors) {
  std::map<std::string, std::string> verdict;
  for (const std::string key : deciding_metrics) {
    const double difference = model.at(key) - opponent.at(key);
    if (std::abs(difference) <= floors.at("floor_" + key))
      verdict[key] = "tie";
    else
      verdict[key] = difference > 0 ? "worse" : "better";
  }
  return verdict;
}

bool loses(const std::map<std::string, std::string>& verdicts) { return most_are(verdicts, "worse"); }

bool wins(const std::map<std::string, std::string>& verdicts) { return most_are(verdicts, "better"); }

}  // namespace graupel::compare
