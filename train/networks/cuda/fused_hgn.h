// Training passes of the hierarchical graph network whose receivers sum activations
// (graph/cuda/forward/aggregation_forward.h).
#pragma once

#include "graph/cuda/forward/aggregation_forward.h"
#include "train/networks/cuda/fused_network.h"

namespace graupel::train {

class FusedHgn : public FusedNetwork {
 public:
  FusedHgn(const ParameterLayout& layout, const at::Tensor& flat, const at::Tensor& gradient)
      : FusedNetwork(layout, flat, gradient) {}
  at::Tensor forward(const DeviceBatch& batch) override;
  void backward(const DeviceBatch& batch, const at::Tensor& grad) override;

 private:
  class BackwardPass;

  bool has_own_decoder() const { return plan().layers.back().outputs == 3; }  ///< kernels for one frame
  /// From the gradient of the result to that of the latents before the decoder.
  float* own_decoder_backward(int64_t particles, const at::Tensor& grad);
  /// From the gradient of the encoder's result.
  void encoder_backward(const DeviceBatch& batch, const float* grad);

  graph::AggregationRecord record_;
  const uint16_t* before_decoder_ = nullptr;
};

}  // namespace graupel::train
