// Non-negative least squares by coordinate descent,
//   w = argmin |A w - b|^2 + pull sum_c |A_c|^2 (w_c - prior_c)^2,  w >= 0,
// one weight after the other to its best value, the others kept (Franc, Hlavac and Navara 2005). It is the solver of
// empirical cubature (An, Kim and James 2008; ECSW, Farhat et al. 2014), whose columns touch few rows. A numerical
// routine of its own: no verb uses it, since weights fitted with it lost to matched points
// (docs/reference/reduced-order.md).
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace graupel::train {

struct NonNegativeOptions {
  int sweeps = 30;     ///< over all weights, at most
  double gain = 1e-3;  ///< part of the objective that a sweep must take away for another one
  double pull = 0;     ///< to the prior; it decides where the rows do not
};

/// `a` [rows, columns], `b` [rows], `prior` [columns], where the weights start; those of columns without entries keep
/// it. Throws ConfigError for sizes that differ, a prior below 0, or values that are not finite.
Eigen::VectorXd non_negative_least_squares(const Eigen::SparseMatrix<double>& a, const Eigen::VectorXd& b,
                                           const Eigen::VectorXd& prior, const NonNegativeOptions& options = {});

}  // namespace graupel::train
