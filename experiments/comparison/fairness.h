// The rules by which models are compared, in one place. docs/reference/fairness.md states them in prose.
//
// Clock: the wall time of the caller around a frame, on a GPU until it has finished there, for networks and solvers
// alike (experiments/models/, graph::FrameTiming::wall); handing a frame out, tracers and searches for a step
// are apart.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "compare/deciding_metrics.h"
#include "core/parallel/device.h"
#include "experiments/models/model_choice.h"

namespace graupel::experiments {

/// Device: all models and MPM run on one, with the same threads, as a speed ratio is of one. Learned models run on a
/// GPU where it is asked for. Throws ConfigError for an unknown word.
Device common_device(const std::string& word, const std::vector<ModelChoice>& models);

/// Scenes: a reduced-order model runs the scene that it was trained on, every other model all scenes.
bool runs_on_all_scenes(ModelKind kind);
/// Throws ConfigError for what reduced-order models do not run: particles that come or go, periodic walls, the plane.
void check_runs_on(const ModelChoice& model, const Scene& scene);

/// Particles: every run is judged on the truth's; one on another grid carries them as tracers, which are born when the
/// truth's are, and leave where the run's own particles do.
bool judged_by_tracers(const mpm::SolverVariant& variant);

/// References: MPM differs from itself by as much as a run whose particles start, or are born, this far off [dx]
/// (position errors), and one that samples the sources with the next seed (all others).
inline constexpr double floor_displacement = compare::resolved_shift;
constexpr uint64_t reseeded(uint64_t seed) { return seed + 1; }

/// Opponent: what a learned model has to beat is a coarse grid at its own largest stable step; mpm:coarse at the data's
/// Courant number where that alone was asked for.
mpm::SolverVariant opponent_of(const std::vector<ModelChoice>& models);

/// One-step errors are given where the model starts from the truth's history, or from the nearest state that it knows;
/// along a rollout of MPM, which decorrelates from the truth, they say nothing of its accuracy.
bool has_one_step_error(ModelKind kind);

// The metrics that decide, ties within MPM's own floor, and what it is to lose: compare/deciding_metrics.h.

/// Ratios to the opponent, "ratio_<metric>": of what a deciding metric is beyond its floor (deciding_floors), which
/// counts a tenth of itself at least: max(error - floor, floor / 10); and of frame_ms.
compare::MetricValues ratios(const compare::MetricValues& model, const compare::MetricValues& opponent,
                             const compare::MetricValues& floors);

}  // namespace graupel::experiments
