// Answers to a parameter sweep that need no model: nothing moves; the training run whose parameters are nearest; and
// linear interpolation between the training runs around: the line for one parameter, the Delaunay simplex for more. A
// model that does not beat them is of no use.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/metrics/displacement_error.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::bench {

/// Training runs that stand for other parameters: their mean with these weights, which sum to 1.
struct TrainingMix {
  std::vector<int> runs;
  std::vector<double> weights;
};
/// Nearest of `runs` [runs][parameters], every parameter over its range.
TrainingMix nearest_run(const std::vector<std::vector<double>>& runs, const std::vector<double>& parameters);
/// The simplex of parameters + 1 runs around, and the weights that give the parameters there. Of all simplices that
/// hold them that of the Delaunay triangulation, for which sum_i w_i |mu_i - mu|^2 is least, among the `nearest_runs`
/// nearest runs. None outside of the runs.
std::optional<TrainingMix> runs_around(const std::vector<std::vector<double>>& runs,
                                       const std::vector<double>& parameters);
inline constexpr std::size_t nearest_runs = 16;

struct BaselineErrors {
  double delta = 0, displacement_relative = 0;
};
struct Baselines {
  BaselineErrors nothing_moves, nearest;
  std::optional<BaselineErrors> linear;
};

/// Of run `i` of a split against its truth, over the frames that the training runs have too. Throws InputError when
/// these have other particles.
Baselines baselines_of_run(const io::TrajectoryReader& train, const io::TrajectoryReader& split, int i);

}  // namespace graupel::bench
