// Node update after aggregation: the FCN on the sums of a tile of receivers, fused with the first linear layer of the
// next step.
#pragma once

#include "graph/topology/tiles.h"
#include "nn/fcn.h"

namespace graupel::graph {

/// What the next step gathers of the new latents, layer(f), as floats or packed (nn/row_kernels.h; on bf16 units
/// alone).
struct NextLayerRows {
  const nn::Linear& layer;
  float* floats = nullptr;
  uint32_t* packed = nullptr;
};

/// f = LayerNorm(W2 hidden + b2), added to f where `add`; then the next rows. Rows of activated `hidden` and f have
/// second.width() columns. Overwrites scratch.output.
void finish_latents(const nn::NormalizedLayer& second, const float* hidden, int32_t rows, bool add, float* latent,
                    const NextLayerRows& next_rows, TileScratch& scratch);

class ReceiverNetwork {
 public:
  enum class Inputs { sum, sum_and_latent };

  ReceiverNetwork() = default;
  /// `fcn` takes [sum] or [sum, latent].
  ReceiverNetwork(const nn::FcnWeights& fcn, Inputs inputs);

  /// Where the sum of row r of a tile goes.
  float* sum(TileScratch& scratch, int32_t r) const { return scratch.sums.data() + int64_t{r} * width_; }
  /// f = FCN(sum), or f = FCN([sum, f]) added to f, for `rows` rows whose sums are in their places; then the next rows.
  void apply(TileScratch& scratch, int32_t rows, float* latent, const NextLayerRows& next_rows) const;

 private:
  int width_ = 0, inputs_ = 1;
  nn::Linear first_;
  nn::NormalizedLayer second_;
};

}  // namespace graupel::graph
