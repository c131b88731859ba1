// The training runs of a sweep as answers that need no model: the run whose parameters are nearest, and linear
// interpolation between the runs around, the line for one parameter and the Delaunay simplex for more. A model that
// does not beat them is of no use.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "io/trajectory/trajectory_file.h"

namespace graupel::experiments {

/// Training runs that stand for other parameters: their mean with these weights, which sum to 1.
struct TrainingMix {
  std::vector<int> runs;
  std::vector<double> weights;
};
/// Nearest of `runs` [runs][parameters], every parameter over its range.
TrainingMix nearest_run(const std::vector<std::vector<double>>& runs, const std::vector<double>& parameters);
/// The simplex of parameters + 1 runs around, and the weights that give the parameters there. Of all simplices that
/// hold them that of the Delaunay triangulation, for which sum_i w_i |mu_i - mu|^2 is least, among the nearest runs
/// that have at most `most_simplices` of them (40 with three parameters). None outside of these.
std::optional<TrainingMix> runs_around(const std::vector<std::vector<double>>& runs,
                                       const std::vector<double>& parameters);
inline constexpr std::size_t most_simplices = 100000;
/// For parameters outside of the runs: linear extrapolation from the nearest parameters + 1 runs that span a simplex,
/// with weights below 0. None where the runs span none.
std::optional<TrainingMix> runs_beyond(const std::vector<std::vector<double>>& runs,
                                       const std::vector<double>& parameters);

class TrainingRuns {
 public:
  /// A data set's folder, whose train.h5 is read, or that file. Throws InputError for a file without runs, or whose
  /// runs have no parameters or other ones than the first.
  explicit TrainingRuns(const std::string& path);

  /// The parameters as a scene has them. Throws ConfigError, naming the first thing that differs, for a scene whose
  /// body, frame time or any key but the parameters is not the runs', for the same body with another seed, and for more
  /// frames than they hold. The body may have other particles, or be on another grid.
  std::vector<double> parameters_in(const Scene& scene, uint64_t seed, int64_t frames) const;

  std::vector<std::string> names() const;                                             ///< of the parameters
  const std::vector<std::vector<double>>& parameters() const { return parameters_; }  ///< [runs][parameters]
  int64_t frames() const { return frames_; }  ///< of the shortest, with the start
  std::size_t particles(int run) const;
  Scene scene() const;  ///< of the first run, with its seed
  /// x = sum_i w_i x_i of a frame [particles, 3] [m].
  std::vector<Vec3d> positions(const TrainingMix& mix, int64_t frame) const;
  /// "friction_angle 0.6 x 33.2 + 0.4 x 34.3" with one parameter, else the numbers of the runs.
  std::string text(const TrainingMix& mix) const;

 private:
  std::string file_;
  io::TrajectoryReader reader_;
  std::vector<io::NamedValue> named_;  ///< parameters of the first run
  std::vector<std::vector<double>> parameters_;
  int64_t frames_ = 0;
};

/// Values alone, in the recipe's order.
std::vector<double> parameter_values(const io::TrajectoryReader& reader, int run);

}  // namespace graupel::experiments
