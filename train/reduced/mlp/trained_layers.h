// The layers of rom/fields/mlp.h from the weights of a network that was trained (train/reduced/mlp/mlp_module.h).
#pragma once

#include <string>
#include <vector>

#include "nn/weights.h"
#include "rom/fields/mlp.h"
#include "train/reduced/mlp/mlp_module.h"

namespace graupel::train {

/// Tensors <name>.weight of `shape`, `out` rows of `in` numbers, and <name>.bias [out]. Throws InputError as
/// nn::Weights::get.
rom::MlpLayer layer_of(const nn::Weights& weights, const std::string& name, int out, int in,
                       const std::vector<int64_t>& shape);
/// Tensors layer0 .. layer5 of a network.
std::vector<rom::MlpLayer> layers_of(const nn::Weights& weights, const MlpShape& shape);

}  // namespace graupel::train
