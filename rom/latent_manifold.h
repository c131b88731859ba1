// Where the training runs went in the latent space: a sheet of one dimension for time and one for each parameter. Off
// it the stress is a guess, and nothing drives a state back; so after every step a part of the way back to the sheet's
// tangent plane at the nearest training states is taken, without a change of velocity.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

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

 private:
  Eigen::MatrixXd latents_;          ///< [r, n]
  std::vector<Eigen::Index> first_;  ///< of every run, and the end
  int dimensions_ = 1;
};

}  // namespace graupel::rom
