// A bound on the error of a run, told without its truth x*, for models of one parameter mu. The training runs can be
// interpolated in mu too, and they tell themselves how good that is:
//   |g(q) - x*| <= |g(q) - g(q_line)| + |g(q_line) - x*|.
// The first term is measured in every frame. The second is what the modes miss of the training runs, and the remainder
// of linear interpolation between the runs mu_1 and mu_2, |f''| |mu - mu_1| |mu - mu_2| / 2, in and out of the range.
// |f''| is the largest with which training runs miss the line between their two neighbours.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "rom/fields/fields.h"

namespace graupel::rom {

struct ReducedModel;

/// What interpolation between the training runs is off by, relative to the displacement over a run.
struct InterpolationErrors {
  double reconstruction = 0;  ///< of the training runs from their latents, largest
  double curvature = 0;       ///< |f''| [1 / unit of the parameter^2], largest
};

/// Some particles of a model, as positions of its latents.
class BoundPoints {
 public:
  explicit BoundPoints(const ReducedModel& model);
  const std::vector<int32_t>& particles() const { return particles_; }
  /// [3 points] [m].
  Eigen::VectorXf positions(const Eigen::VectorXd& latent);
  const Eigen::VectorXf& reference() const { return reference_; }

 private:
  std::vector<int32_t> particles_;
  std::unique_ptr<PointPositions<float>> field_;
  std::vector<float> tiles_;
  Eigen::VectorXf reference_;
};

/// `curvature` of a model's training runs; none for several parameters, fewer than three runs, or runs of different
/// lengths.
std::optional<double> interpolation_curvature(const ReducedModel& model);

/// The bound on one run, frame by frame.
class InterpolationBound {
 public:
  /// The remainder counts twice: between training runs that stood in for unseen ones it was 0.7 to 1.7 times the one
  /// predicted from their neighbours.
  static constexpr double safety = 2;

  /// None for a model without InterpolationErrors.
  static std::optional<InterpolationBound> of(const ReducedModel& model, double parameter);

  /// The state at a time [s] after the start, in the order of time.
  void add(const std::vector<double>& latent, double time);
  /// Of the displacement, over the frames so far; none before the first and beyond the time of the training.
  std::optional<double> value() const;
  double interpolation_error() const { return interpolation_error_; }  ///< the second term

 private:
  InterpolationBound(const ReducedModel& model, Eigen::MatrixXd line, double interpolation_error);

  BoundPoints points_;
  Eigen::MatrixXd line_;  ///< latents of the line's snapshots [r, snapshots]
  double frame_time_, interpolation_error_;
  double distance2_ = 0, displacement2_ = 0;
  bool beyond_ = false;
};

}  // namespace graupel::rom
