// The gradient of a network in training is the slope of its loss: central differences at three places of each tensor.
#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

/// `module` in double precision; it keeps nudged weights.
inline void expect_slope_of_loss(MlpModule& module, const MlpBatch& batch) {
  nn::Weights gradient;
  module.loss_and_gradient(batch, &gradient);
  const nn::Weights weights = module.state(MlpArray::weights);
  constexpr float h = 1.0f / 1024;
  for (const auto& [name, tensor] : weights.tensors) {
    const std::vector<float> values = tensor.as_float(), slope = gradient.tensors.at(name).as_float();
    for (const std::size_t i : {std::size_t{0}, values.size() / 2, values.size() - 1}) {
      double loss[2];
      for (const int side : {0, 1}) {
        std::vector<float> nudged = values;
        nudged[i] += side ? h : -h;
        nn::Weights changed = weights;
        changed.tensors[name] = nn::Tensor::from_float(nudged, tensor.shape);
        module.set_state(MlpArray::weights, changed);
        loss[side] = module.loss_and_gradient(batch, nullptr);
      }
      const double moved = static_cast<double>((values[i] + h) - (values[i] - h)),
                   expected = (loss[1] - loss[0]) / moved;
      EXPECT_NEAR(static_cast<double>(slope[i]), expected, 1e-4 * (0.01 + std::abs(expected))) << name << " " << i;
    }
  }
}

}  // namespace graupel::train
