#include "train/reduced/mlp/trained_layers.h"

namespace graupel::train {

rom::MlpLayer layer_of(const nn::Weights& weights, const std::string& name, int out, int in,
                       const std::vector<int64_t>& shape) {
  return {in, out, weights.get(name + ".weight", shape), weights.get(name + ".bias", {out})};
}

std::vector<rom::MlpLayer> layers_of(const nn::Weights& weights, const MlpShape& shape) {
  std::vector<rom::MlpLayer> layers;
  for (int l = 0; l < rom::Mlp::layer_count; ++l) {
    const int in = l == 0 ? shape.inputs() : shape.width,
              out = l == rom::Mlp::hidden_layers ? shape.outputs : shape.width;
    layers.push_back(layer_of(weights, "layer" + std::to_string(l), out, in, {out, in}));
  }
  return layers;
}

}  // namespace graupel::train
