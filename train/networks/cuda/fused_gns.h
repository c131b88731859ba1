// The graph network simulator's passes in mixed precision on a GPU (graph/cuda/forward/message_forward.h). The function
// is that of TorchEngine, with edge latents in bf16. Latent width 128, one hidden layer. Internal, as torch_layers.h.
//
// Memory is that of arrays [edges, 128] in bf16: the latents before every step, one gradient, and three arrays of what
// the backward pass of one network leaves for its weights' gradients, which are made before the next one. With
// checkpoints only the latents of every k-th step are kept, and those between are made again on the way back.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "graph/cuda/forward/message_forward.h"
#include "train/networks/mixed_precision_network.h"
#include "train/networks/parameter_layout.h"
#include "train/networks/torch_layers.h"

namespace graupel::train {

class FusedGns : public MixedPrecisionNetwork, private graph::RowMemory, private graph::EdgeMemory {
 public:
  /// `checkpoint_layers` = k; 0: everything is kept.
  FusedGns(const graph::GnsConfig& config, int64_t checkpoint_layers, const ParameterLayout& layout,
           const at::Tensor& flat, const at::Tensor& gradient);

  at::Tensor forward(const DeviceBatch& batch) override;
  void backward(const DeviceBatch& batch, const at::Tensor& grad) override;

 private:
  /// Arrays of edges after those of the latents.
  enum Scratch { hidden, d_raw, d_sum, latent_grad, scratch_arrays };
  /// What a network's backward pass leaves for its weights' gradients; overwritten by the next one.
  struct Traces {
    uint16_t *hidden, *d_raw, *d_sum;
  };

  float* rows32(int64_t rows) override;
  uint16_t* rows16(int64_t rows) override;
  bool keeps_all() const override { return true; }
  uint16_t* latent(int64_t k) override { return edge_array(latent_array(k)); }
  uint16_t* message() override { return edge_array(latent_arrays_ + hidden); }

  /// Steps whose latents are kept, the rest of a group of steps taking turns in the arrays behind.
  int64_t latent_array(int64_t k) const;
  uint16_t* edge_array(int64_t array) const;
  void make_room(int64_t edges);
  Traces edge_traces() const;

  void step_backward(int64_t k, const DeviceLevel& links);
  /// The edge latents of the steps after `first`, before `last`, from those of `first`.
  void latents_again(int64_t first, int64_t last);
  void edge_encoder_backward(const DeviceLevel& links);
  void node_encoder_backward(const DeviceBatch& batch);

  /// Goes back through a network and adds the products for its W2, b2, gamma and beta.
  graph::FusedMlpGradient back_through(const std::string& name, graph::FusedMlpGradient gradient, const Traces& traces);
  /// Gradient of columns of W1: sum over rows of d x, `bias` the sum of d.
  void add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad, int64_t first_column,
                   int64_t columns, const at::Tensor& bias = {});
  const uint16_t* packed(const at::Tensor& numbers);
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }

  graph::GnsConfig config_;
  int64_t group_;          ///< steps of which the first one's latents are kept
  int64_t latent_arrays_;  ///< of edges
  std::map<std::string, Fcn> fcns_;
  at::Tensor embedding_, embedding_grad_;
  at::TensorOptions number_, half_;
  graph::PackedNetwork packed_;
  graph::WeightProducts products_;
  at::Tensor edge_rows_;  ///< [arrays, room, 128]
  int64_t room_ = 0;
  std::vector<at::Tensor> kept_;  ///< what launches of this step read and write
  graph::MessageRecord record_;
  FcnRecord decoder_;
  float* node_grad_ = nullptr;  ///< [nodes, 128] of the latents after the step that comes next on the way back
  Traces node_traces_{};
};

}  // namespace graupel::train
