// The metrics that decide who wins, and what it is to lose: differences within the noise floor of MPM itself are ties.
#pragma once

#include <map>
#include <string>

#include "compare/metrics/metric_list.h"

namespace graupel::compare {

/// All smaller where better: where a particle is, where mass is, and how much of it.
inline constexpr const char* deciding_metrics[] = {"position_mse_all", "sinkhorn", "density_error"};
inline constexpr int losing_metrics = 2;

/// "better", "worse" or "tie" in each deciding metric. Differences up to MPM's own floor (floor_<metric>, 0 where it
/// was not computed) are ties.
std::map<std::string, std::string> verdicts(const MetricValues& model, const MetricValues& opponent,
                                            const MetricValues& floors);
/// Worse in two deciding metrics or more, whatever the speed.
bool loses(const std::map<std::string, std::string>& verdicts);
/// Better in two of them or more.
bool wins(const std::map<std::string, std::string>& verdicts);

}  // namespace graupel::compare
