// What a network that sums activations does with the sums of a tile of receivers: its FCN, and of the new latents what
// the next step gathers.
#pragma once

#include "graph/tiles.h"
#include "nn/fcn.h"

namespace graupel::graph {

class ReceiverNetwork {
 public:
  enum class Inputs { sum, sum_and_latent };

  ReceiverNetwork() = default;
  /// `fcn` takes [sum] or [sum, latent].
  ReceiverNetwork(const nn::FcnWeights& fcn, Inputs inputs);

  /// Where the sum of row r of a tile goes.
  float* sum(TileScratch& scratch, int32_t r) const { return scratch.input.data() + int64_t{r} * inputs_ * width_; }
  /// f = FCN(sum), or f = FCN([sum, f]) added to f, for `rows` rows whose sums are in their places.
  void apply(TileScratch& scratch, int32_t rows, float* latent) const;

 private:
  int width_ = 0, inputs_ = 1;
  nn::Linear first_;
  nn::NormalizedLayer second_;
};

}  // namespace graupel::graph
