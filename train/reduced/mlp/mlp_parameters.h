// Names, shapes and places of a network's weights (train/reduced/mlp/mlp_module.h) in one flat array, and their values
// before the training.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

/// One tensor of the network: `count` numbers from `begin` of the flat array, row-major.
struct MlpParameter {
  std::string name;
  std::vector<int64_t> shape;
  int64_t begin = 0, count = 0;
  int64_t fan_in = 0, fan_out = 0;  ///< 0: a bias
};

/// layer0 .. layer5, then the encoder's where the shape has one: <name>.weight and <name>.bias of each.
std::vector<MlpParameter> mlp_parameters(const MlpShape& shape);
/// Numbers of the flat array, gaps for alignment included.
int64_t flat_size(const std::vector<MlpParameter>& parameters);
/// Glorot and Bengio 2010: weights uniform within sqrt(6 / (in + out)), biases 0. The same seed and shape give the same
/// numbers with any libtorch.
std::vector<float> xavier_values(const std::vector<MlpParameter>& parameters, const MlpShape& shape, uint64_t seed);

}  // namespace graupel::train
