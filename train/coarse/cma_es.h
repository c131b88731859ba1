// CMA-ES: evolution of a normal distribution whose covariance follows the successful steps. Hansen 2016, "The CMA
// evolution strategy: a tutorial" (arXiv 1604.00772), sections 2 to 4 and appendix A, without negative weights.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

namespace graupel::train {

class CmaEs {
 public:
  /// `start` [n]; `spread` [n]: standard deviation of the first samples along each coordinate, above 0. At least four
  /// samples a generation; the same seed gives the same samples.
  CmaEs(const std::vector<double>& start, const std::vector<double>& spread, int samples, uint64_t seed);

  /// The points to judge next, [samples][n].
  std::vector<std::vector<double>> sample();
  /// Takes the costs of the points of the last sample(), lower is better; a cost that is not finite ranks last.
  void update(const std::vector<double>& costs);

  std::vector<double> mean() const;
  double step_size() const { return sigma_; }  ///< sigma, of the first spread
  int64_t generation() const { return generation_; }

 private:
  Eigen::VectorXd scaled(const Eigen::VectorXd& x) const { return spread_.cwiseProduct(x); }

  int samples_;
  uint64_t seed_;
  Eigen::VectorXd spread_, mean_, weights_;  ///< the mean in units of the spread
  Eigen::VectorXd path_sigma_, path_c_;      ///< evolution paths of the step size and of the covariance
  Eigen::MatrixXd covariance_, axes_;        ///< C = B D^2 B^T and B D
  Eigen::MatrixXd inverse_root_;             ///< C^-1/2
  std::vector<Eigen::VectorXd> drawn_;
  double sigma_ = 1, mass_ = 0;  ///< mass_: variance-effective number of parents
  int64_t generation_ = 0;
};

}  // namespace graupel::train
