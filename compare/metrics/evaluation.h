// All rollout metrics of one run against the truth (docs/reference/metrics.md).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "compare/metrics/metric_list.h"
#include "compare/metrics/one_step_error.h"
#include "compare/metrics/particle_run.h"
#include "core/scene/scene.h"
#include "sparsegrid/obstacle_set.h"

namespace graupel::compare {

/// Errors over time, entry k is frame k + 1.
struct ErrorCurves {
  std::vector<double> position;        ///< mean squared distance [m^2]
  std::vector<double> density;         ///< relative L1
  std::vector<double> kinetic_energy;  ///< of the run, not an error [J]
};

struct Evaluation {
  MetricValues values;                            ///< group rollout
  std::map<std::string, MetricValues> materials;  ///< by particle_type_name
  ErrorCurves curves;
};

/// Compares the frames that both runs have; without position errors where they have not the same particles (another
/// sampling seed). Throws InputError when the run lacks a material of the truth.
Evaluation evaluate_rollout(const Scene& scene, const sparsegrid::ObstacleSet& obstacles, const ParticleRun& truth,
                            const ParticleRun& run);

/// Metrics of group one_step.
MetricValues one_step_values(const OneStepError& error);

/// What a run cost. Times are medians over its frames [s]; of a reduced-order model, network: decoding and inversion,
/// grid_build: the grid's step, features: the search for integration points.
struct RunCost {
  double frame = 0, network = 0, grid_build = 0, features = 0, projection = 0, output = 0;
  double peak_bytes = 0, added_bytes = 0;
  double kept_bytes = 0;     ///< of the added ones: frames that the comparison keeps
  double weights_bytes = 0;  ///< of the weights file, which was read before
  double substeps = 1;       ///< mean a frame; 1 for a graph network
  double bundle = 1;         ///< frames that a graph network predicts at once
  double search = 0;         ///< wall time of the search for a step before the run [s]
  double events = 0;         ///< of a frame by events on the GPU, where a network runs there [s]
  double device_bytes = 0;   ///< of a GPU's memory, beyond what the process had there before
};
/// Metrics of group cost but loses_to_coarse; `mpm_frame` [s] is the time of a frame of mpm on the same threads.
MetricValues cost_values(const RunCost& cost, std::size_t particles, double mpm_frame);

/// Metrics of group floors, from MPM with moved particles and MPM with another sampling seed.
MetricValues floor_values(const Evaluation& moved, const Evaluation& reseeded);

}  // namespace graupel::compare
