// Fits the branches of factored fields: radial basis functions with a linear part (rom/fields/coefficient_map.h) by
// ridge regression. The ridge is the one that predicts held-out runs best: snapshots of one run lie close together, so
// holding out single ones would tell nothing.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "rom/fields/coefficient_map.h"

namespace graupel::train {

struct MapFit {
  rom::CoefficientMap map;
  double ridge = 0;
  double held_out_error = 0;  ///< relative, root of the sum of squares over the held-out runs
};

/// c(z) for rows of `inputs` [n, d] and `outputs` [n, m]; `run` [n]. `centers`: at so many rows, far apart; at every
/// row where there are no more.
MapFit fit_map(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs, const std::vector<int>& run, int centers);

/// M(z) with outputs = M(z) rates: `rates` [n, r]; the map's outputs are [m, r]. `centers`: how many, far apart.
MapFit fit_rate_map(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& rates, const Eigen::MatrixXd& outputs,
                    const std::vector<int>& run, int centers);

}  // namespace graupel::train
