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

std::map<std::string, std::string> verdicts(const MetricValues& model, const MetricValues& opponent,
                                            const MetricValues& floors) {
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

bool loses(const std::map<std::string, std::string>& verdicts) { return most_are(verdicts, "worse"); }

bool wins(const std::map<std::string, std::string>& verdicts) { return most_are(verdicts, "better"); }

}  // namespace graupel::compare
