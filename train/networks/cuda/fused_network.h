// The fused passes of the hierarchical graph network of the paper, whose receivers sum messages.
#pragma once

#include <string>

#include "train/networks/cuda/fused_passes.h"

namespace graupel::train {

class FusedNetwork : public FusedPasses {
 public:
  FusedNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
               const at::Tensor& gradient)
      : FusedPasses(config, layout, flat, gradient) {}

 private:
  graph::RowLatents to_decoder(const graph::HgnGraph& graph) override;
  float* back_to_encoder(const DeviceBatch& batch, float* grad_particles) override;
  const graph::RowNetwork& encoder() const override { return record_.encoder; }

  float* pass_messages_backward(const std::string& block, const graph::HgnRecord::Block& record,
                                const DeviceLevel& level, float* grad);
  /// What pairs leave to their particles: weights of the particle's and the offset's part, and grad_particles.
  void pairs_to_particles(const DeviceBatch& batch, const std::string& name, const graph::RowNetworkGradient& pairs,
                          int64_t particle_column, float offset_sign, float* grad_particles);

  graph::HgnRecord record_;
};

}  // namespace graupel::train
