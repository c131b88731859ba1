// The metrics that decide who wins, and what it is to lose: differences within the noise floor of MPM itself are ties.
#pragma once

#include <map>
#include <string>

#include "compare/metrics/metric_list.h"

namespace graupel::compare {

/// All smaller where better: where a particle is, where mass is, and how much of it.
inline constexpr const char* deciding_metrics[] = {"position_mse_all", "sinkhorn", "density_error"};
inline constexpr int losing_metrics = 2;

/// Shift of matter that is told from none [dx]: to the Sinkhorn divergence, whose iteration ends at a tolerance, a
/// tenth of it is 0.
inline constexpr double resolved_shift = 1e-4;
/// Error of such a shift, by deciding metric: its square [m^2], and the part of the mass that changes nodes of the
/// density grid.
MetricValues resolution(double dx);
/// "floor_<metric>" of the deciding metrics: the measured one, 0 where there is none, but the resolution at least.
MetricValues deciding_floors(const MetricValues& measured, double dx);

/// "better", "worse" or "tie" in each deciding metric. Differences up to the floor (deciding_floors) are ties.
std::map<std::string, std::string> verdicts(const MetricValues& model, const MetricValues& opponent,
                                            const MetricValues& floors);
/// Worse in two deciding metrics or more, whatever the speed.
bool loses(const std::map<std::string, std::string>& verdicts);
/// Better in two of them or more.
bool wins(const std::map<std::string, std::string>& verdicts);

}  // namespace graupel::compare
