// Activations and the pieces of layer normalisation as scalar functions, for host and device.
#pragma once

#include <cmath>

#include "core/parallel/host_device.h"

namespace graupel::nn {

inline constexpr float leaky_slope = 0.01f;         ///< PyTorch's default
inline constexpr float layer_norm_epsilon = 1e-5f;  ///< PyTorch's default

/// x for x >= 0, else slope x; a slope of 0 is ReLU.
template <typename T>
GRAUPEL_HD T leaky_relu(T x, T slope = T(leaky_slope)) {
  return x >= T(0) ? x : slope * x;
}

/// 1 / sqrt(variance + eps), from the mean of the squares of centred values.
template <typename T>
GRAUPEL_HD T layer_norm_scale(T mean_square) {
  return T(1) / std::sqrt(mean_square + T(layer_norm_epsilon));
}

}  // namespace graupel::nn
