// What the CUDA networks of training compute, by autograd in double precision: values and gradients are rounded to bf16
// where those kernels round them (train/networks/cuda/), so that gradients agree to the rounding of sums.
#pragma once

#include <vector>

#include "train/config/network_config.h"
#include "train/data/batch.h"

namespace graupel::train {

struct RoundedReference {
  double loss = 0;
  std::vector<double> gradient;  ///< as ParameterLayout
};

/// Loss and gradient for weights drawn from `seed`. Without `rounds` nothing is rounded: the exact gradient, by other
/// operations than TorchEngine's own. HGN that sums activations, and GNS of one hidden layer.
RoundedReference rounded_reference(const NetworkConfig& config, uint64_t seed, const Batch& batch, bool rounds = true);

/// Fails where a tensor of `gradient` differs from that of `expected` by more than `limit` of its norm.
void expect_gradients_near(const NetworkConfig& config, const std::vector<double>& gradient,
                           const std::vector<double>& expected, double limit);

}  // namespace graupel::train
