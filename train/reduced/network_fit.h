// Fits the branches of factored fields as small networks on top of a linear part (rom/fields/mlp_map.h): least squares,
// then Adam (Kingma and Ba 2015) on what that leaves, in batches of snapshots, at a rate that falls to 0 as half a
// cosine. The loss is the error of the field: all coefficients count as they are. The inputs of a step have noise: the
// states of a sweep lie on a sheet in the space of inputs, and without it the network is anything beside the sheet,
// where a rollout drifts to. Errors in held-out runs as in map_fit.h.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "rom/fields/mlp_map.h"

namespace graupel::train {

struct NetworkFitOptions {
  int width = 64;  ///< of the hidden layers
  int64_t steps = 3000, batch = 128;
  double learning_rate = 1e-2;  ///< the first
  double noise = 0.1;           ///< standard deviation of what is added to standardised inputs
  uint64_t seed = 0;
  std::function<void(const std::string&)> message = {};  ///< one call at a time, from any thread
};

struct NetworkFit {
  rom::MlpMap map;
  double held_out_error = 0;  ///< relative, root of the sum of squares over the held-out runs
};

/// c(z) for rows of `inputs` [n, d] and `outputs` [n, m]; `run` [n]. Throws DivergedError when the loss is no longer a
/// number.
NetworkFit fit_network(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& outputs, const std::vector<int>& run,
                       const NetworkFitOptions& options);

/// M(z) with outputs = M(z) rates: `rates` [n, r]; the map's outputs are [m, r].
NetworkFit fit_rate_network(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& rates, const Eigen::MatrixXd& outputs,
                            const std::vector<int>& run, const NetworkFitOptions& options);

}  // namespace graupel::train
