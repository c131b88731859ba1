// The graph network simulator's passes in mixed precision on a GPU (graph/cuda/forward/message_forward.h). The function
// is that of TorchEngine, with edge latents in bf16. Latent width 128, one hidden layer. Internal, as torch_layers.h.
//
// Memory is that of arrays [edges, 128] in bf16: the latents before every step, one gradient, and three arrays of what
// the backward pass of one network leaves for its weights' gradients, which are made before the next one. With
// checkpoints only the latents of every k-th step are kept, and those between are made again on the way back.
#pragma once

#include "graph/cuda/forward/message_forward.h"
#include "train/networks/cuda/fused_network.h"

namespace graupel::train {

class FusedGns : public FusedNetwork, private graph::EdgeMemory {
 public:
  /// `checkpoint_layers` = k; 0: everything is kept.
  FusedGns(const ParameterLayout& layout, int64_t checkpoint_layers, const at::Tensor& flat,
           const at::Tensor& gradient);

  at::Tensor forward(const DeviceBatch& batch) override;
  void backward(const DeviceBatch& batch, const at::Tensor& grad) override;

 private:
  /// Arrays of edges after those of the latents.
  enum Scratch { hidden, d_raw, d_sum, latent_grad, scratch_arrays };

  uint16_t* latent(int64_t k) override { return edge_array(latent_array(k)); }
  uint16_t* message() override { return edge_array(latent_arrays_ + hidden); }

  /// Steps whose latents are kept, the rest of a group of steps taking turns in the arrays behind.
  int64_t latent_array(int64_t k) const;
  uint16_t* edge_array(int64_t array) const { return f16(edge_rows_) + array * capacity_ * h; }
  void ensure_capacity(int64_t edges);
  /// Of the network that goes back; overwritten by the next one.
  Traces edge_traces() const {
    return {edge_array(latent_arrays_ + hidden), edge_array(latent_arrays_ + d_raw),
            edge_array(latent_arrays_ + d_sum)};
  }

  void step_backward(int64_t k, const DeviceLevel& links);
  /// The edge latents of the steps after `first`, before `last`, from those of `first`.
  void latents_again(int64_t first, int64_t last);
  void edge_encoder_backward(const DeviceLevel& links);
  void node_encoder_backward(const DeviceBatch& batch);

  int64_t steps_;
  int64_t group_;          ///< steps of which the first one's latents are kept
  int64_t latent_arrays_;  ///< of edges
  at::Tensor edge_rows_;   ///< [arrays, capacity, 128]
  int64_t capacity_ = 0;
  graph::MessageRecord record_;
  float* node_grad_ = nullptr;  ///< [nodes, 128] of the latents after the step that comes next on the way back
  Traces node_traces_{};
};

}  // namespace graupel::train
