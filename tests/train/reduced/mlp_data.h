// A small network in training with random data, on either device.
#pragma once

#include <string>
#include <vector>

#include "core/math/random.h"
#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

inline constexpr int64_t mlp_snapshots = 5, mlp_points = 70;

inline std::vector<float> noise(std::size_t count, uint64_t stream) {
  const Random random(7, RandomPurpose::test, stream);
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<float>(random.uniform(i, 0, -1.5, 1.5));
  return values;
}

inline constexpr double all_on_device = 1e9;  ///< [bytes]

/// A module with random data, and biases that are not 0. `limit`: of MlpModule::set_targets.
inline MlpModule module_of(const MlpShape& shape, NumberType number, Device device = Device::cpu,
                           StepLaunch launch = StepLaunch::graph, double limit = all_on_device) {
  MlpModule module(shape, device, 3, number, launch);
  nn::Weights weights = module.state(MlpArray::weights);
  for (auto& [name, tensor] : weights.tensors)
    if (name.ends_with(".bias"))
      tensor = nn::Tensor::from_float(noise(static_cast<std::size_t>(tensor.count()), 50), tensor.shape);
  module.set_state(MlpArray::weights, weights);
  module.set_points(noise(mlp_points * 3, 1));
  module.set_states(noise(static_cast<std::size_t>(mlp_snapshots * (shape.latents + shape.parameters)), 2));
  module.set_targets(noise(static_cast<std::size_t>(mlp_snapshots * mlp_points * shape.targets()), 3), limit);
  if (shape.tangents) {
    module.set_rates(noise(static_cast<std::size_t>(mlp_snapshots * shape.latents), 6));
    std::vector<float> factors = noise(static_cast<std::size_t>(shape.targets()), 7);
    for (float& w : factors) w = w * w + 0.1f;
    module.set_loss_weights(factors);
  }
  if (shape.encoder_particles > 0)
    module.set_encoder_positions(noise(static_cast<std::size_t>(mlp_snapshots * 3 * shape.encoder_particles), 4));
  return module;
}

}  // namespace graupel::train
