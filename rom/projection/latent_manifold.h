// Where the training runs went in the latent space: a sheet of one dimension for time and one for each parameter. Off
// it the stress is a guess, and nothing drives a state back; so after every step a part of the way back is taken,
// without a change of velocity. With one parameter, whose value is known, the way leads to the curve between the two
// neighbouring runs; with more of them, to the sheet's tangent plane at the nearest training states.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "rom/projection/latent_state.h"

namespace graupel::rom {

class LatentManifold {
 public:
  LatentManifold() = default;
  /// `latents` [n, r] of the training snapshots in the order of time, run after run; `run` [n] ascending; `dimensions`
  /// of the sheet.
  LatentManifold(const std::vector<float>& latents, int r, const std::vector<int32_t>& run, int dimensions);

  /// The point of the tangent plane that is nearest to q: the plane of largest spread, through the weighted mean, of
  /// the states nearest to q of the nearest runs and of their neighbours in time. q itself where there is one run only.
  Eigen::VectorXd project(const Eigen::VectorXd& q) const;

  /// Where the runs would go at another value of their one parameter, by linear interpolation between the two runs on
  /// either side, snapshot by snapshot, [r, snapshots of a run]; none for runs of different lengths. `values` [runs].
  Eigen::MatrixXd between(const std::vector<float>& values, double value) const;

 private:
  Eigen::MatrixXd latents_;          ///< [r, n]
  std::vector<Eigen::Index> first_;  ///< of every run, and the end
  int dimensions_ = 1;
};

/// The point of a polyline [r, n] that is nearest to q, on its parts within curve_window of `place`, counted in parts.
Eigen::VectorXd nearest_on_curve(const Eigen::MatrixXd& curve, const Eigen::VectorXd& q, double place);

}  // namespace graupel::rom
