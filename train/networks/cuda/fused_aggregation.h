// The fused passes of the hierarchical graph network whose receivers sum activations
// (graph/cuda/forward/aggregation_forward.h).
#pragma once

#include <string>

#include "graph/cuda/forward/aggregation_forward.h"
#include "train/networks/cuda/fused_hgn.h"

namespace graupel::train {

class FusedAggregation : public FusedHgn {
 public:
  FusedAggregation(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                   const at::Tensor& gradient)
      : FusedHgn(config, layout, flat, gradient) {}

 private:
  graph::RowLatents to_decoder(const graph::NetworkGraph& graph) override;
  float* back_to_encoder(const DeviceBatch& batch, float* grad_particles) override;
  const graph::FusedMlp& encoder() const override { return record_.encoder; }

  /// Back through the FCN `name` on [sum] or [sum, nodes], from the gradient g of its results: adds the products for
  /// all its weights, returns the gradient of the sum. To `nodes` goes the nodes' gradient, g included.
  const uint16_t* update_backward(const std::string& name, const graph::FusedMlp& network, const float* g,
                                  float* nodes = nullptr);
  class BackwardPass;

  graph::AggregationRecord record_;
};

}  // namespace graupel::train
