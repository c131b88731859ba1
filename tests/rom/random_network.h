// Networks with random weights, for tests.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "core/math/random.h"
#include "rom/networks/mlp.h"

namespace graupel::rom::test {

inline double network_noise(uint64_t i) { return Random(5, RandomPurpose::test).uniform(i, 0, -1, 1); }

/// Random weights of about Xavier's size.
inline Mlp random_network(int inputs, int width, int outputs, uint64_t seed) {
  std::vector<MlpLayer> layers;
  uint64_t draw = seed * 1000000;
  for (int l = 0; l < Mlp::layer_count; ++l) {
    MlpLayer layer;
    layer.in = l == 0 ? inputs : width;
    layer.out = l == Mlp::hidden_layers ? outputs : width;
    for (int i = 0; i < layer.in * layer.out; ++i)
      layer.weight.push_back(static_cast<float>(std::sqrt(6.0 / (layer.in + layer.out)) * network_noise(draw++)));
    for (int i = 0; i < layer.out; ++i) layer.bias.push_back(static_cast<float>(0.3 * network_noise(draw++)));
    layers.push_back(layer);
  }
  Standardization input, output;
  for (int i = 0; i < inputs; ++i) {
    input.shift.push_back(0.1 * i);
    input.scale.push_back(1 + 0.2 * i);
  }
  for (int i = 0; i < outputs; ++i) {
    output.shift.push_back(1.0 + i);
    output.scale.push_back(2.0 + 0.5 * i);
  }
  return {std::move(layers), input, output};
}

}  // namespace graupel::rom::test
