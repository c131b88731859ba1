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

struct ReferenceOptions {
  bool rounds = true;  ///< without it nothing is rounded: the exact gradient, by other operations than TorchEngine's
  double disturbance = 0;  ///< every other weight is multiplied by 1 + this
};

/// Loss and gradient for weights drawn from `seed`. HGN that sums activations, and GNS of one hidden layer.
RoundedReference rounded_reference(const NetworkConfig& config, uint64_t seed, const Batch& batch,
                                   const ReferenceOptions& options = {});

/// Norm of the difference of each tensor over the norm of `expected`, in the order of the layout's parameters;
/// infinite where `expected` is 0 and `gradient` is not.
std::vector<double> relative_differences(const NetworkConfig& config, const std::vector<double>& gradient,
                                         const std::vector<double>& expected);

/// Fails where a tensor of `gradient` differs from that of `expected` by more than `limit` of its norm, plus 1.5
/// times the tensor's own `floor` (empty: none).
void expect_gradients_near(const NetworkConfig& config, const std::vector<double>& gradient,
                           const std::vector<double>& expected, double limit, const std::vector<double>& floor = {});

/// Gradient in mixed precision on a GPU beside that of the reference that rounds at the same places: each tensor within
/// 3 % plus 1.5 times its floor, the whole within 8 % of double precision without rounding; the same bytes in every
/// run.
///
/// Floor: how far the reference's own tensor moves when weights are disturbed by 1e-7 and by 1e-6, the error of sums in
/// f32. A disturbance d flips the rounding of a share d/q of all numbers, q = 2^-8; a flip moves a number by q, so a
/// layer turns d into sqrt(d q), and a few layers carry 1e-7 to the size of the rounding itself.
/// Targets are given a mean, so that gradients of particles add up; where they cancel, rounding is most of a gradient.
void check_mixed_gradient(const NetworkConfig& config, Batch batch);

}  // namespace graupel::train
