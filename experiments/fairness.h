// The rules by which models are compared, in one place. docs/fairness.md states them in prose.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "compare/metric_list.h"
#include "core/device.h"
#include "experiments/model_runs.h"

namespace graupel::experiments {

/// Device: all models and MPM run on one, with the same threads, as a speed ratio is of one. Learned models run on a
/// GPU where it is asked for. Throws ConfigError for an unknown word.
Device common_device(const std::string& word, const std::vector<ModelChoice>& models);

/// Opponent: what a learned model has to beat is a coarse grid at its own largest stable step; mpm:coarse at the data's
/// Courant number where that alone was asked for.
mpm::SolverVariant opponent_of(const std::vector<ModelChoice>& models);

/// One-step errors are given where the model starts from the truth's history, or from the nearest state that it knows;
/// along a rollout of MPM, which decorrelates from the truth, they say nothing of its accuracy.
bool has_one_step_error(ModelKind kind);

/// The metrics that decide, all smaller where better: where a particle is, where mass is, and how much of it.
inline constexpr const char* deciding_metrics[] = {"position_mse_all", "sinkhorn", "density_error"};
inline constexpr int losing_metrics = 2;

/// "better", "worse" or "tie" in each deciding metric. Differences up to MPM's own floor (floor_<metric>, 0 where it
/// was not computed) are ties.
std::map<std::string, std::string> verdicts(const compare::MetricValues& model, const compare::MetricValues& opponent,
                                            const compare::MetricValues& floors);
/// Worse in two deciding metrics or more, whatever the speed.
bool loses(const std::map<std::string, std::string>& verdicts);

}  // namespace graupel::experiments
