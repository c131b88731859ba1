// Forward and backward pass of a hierarchical graph network on a GPU, by graph/cuda/fused_mlp/row_layers.h: products in
// bf16 with f32 sums, residual sums and weights in f32. What the backward pass can compute anew is not kept. The
// function is that of the passes on libtorch tensors (train/networks/torch_engine.h). Latent width 128. Internal, as
// torch_layers.h. This is what the network's forms (graph::Aggregation) have in common.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "graph/cuda/aggregation/activation_aggregation.h"
#include "graph/cuda/forward/packed_network.h"
#include "train/networks/mixed_precision_network.h"
#include "train/networks/torch_layers.h"

namespace graupel::train {

class FusedHgn : public MixedPrecisionNetwork, protected graph::RowMemory {
 public:
  at::Tensor forward(const DeviceBatch& batch) override;
  void backward(const DeviceBatch& batch, const at::Tensor& grad) override;

 protected:
  FusedHgn(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
           const at::Tensor& gradient);

  static constexpr int64_t h = graph::layer_width;
  static constexpr int corners = 8;
  static float* f32(const at::Tensor& tensor) { return static_cast<float*>(tensor.data_ptr()); }
  static uint16_t* f16(const at::Tensor& tensor) { return static_cast<uint16_t*>(tensor.data_ptr()); }
  static const int32_t* index(const at::Tensor& tensor) {
    return tensor.defined() ? static_cast<const int32_t*>(tensor.data_ptr()) : nullptr;
  }

  /// Latents before the decoder.
  virtual graph::RowLatents to_decoder(const graph::NetworkGraph& graph) = 0;
  /// From the gradient of the latents before the decoder to that of the encoder's result; adds the products for the
  /// weights between them.
  virtual float* back_to_encoder(const DeviceBatch& batch, float* grad_particles) = 0;
  /// The encoder as the forward pass ran it.
  virtual const graph::FusedMlp& encoder() const = 0;

  float* rows32(int64_t rows) override;
  uint16_t* rows16(int64_t rows) override;
  bool keeps_all() const override { return true; }
  /// [rows, columns] f32 as [rows, 128] bf16.
  const uint16_t* packed(const at::Tensor& numbers);

  /// Memory for partial sums [rows, parts, 128].
  float* partials(int64_t rows, int64_t parts);

  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }
  const Fcn::Layer& gather(const std::string& name) const { return gathers_.at(name); }
  /// Goes back through `name` and adds the products for its W2, b2, gamma and beta.
  graph::FusedMlpGradient back_through(const std::string& name, graph::FusedMlpGradient gradient);
  /// Back through prolong.<l>: to `skip` the gradient of level l's cells, returns that of level l + 1's.
  float* prolong_backward(std::size_t l, const graph::FusedMlp& network, const DeviceBatch& batch, float* g,
                          float* skip);
  /// Gradient of columns of W1: sum over rows of d x, `bias` the sum of d.
  void add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad, int64_t first_column,
                   int64_t columns, const at::Tensor& bias = {});

  /// Runs a kernel of activation_aggregation.h, whose partial sums are the gradient of the last three columns of a
  /// layer.
  template <typename Gradient>
  void offsets_backward(const at::Tensor& w_grad, Gradient gradient) {
    constexpr int parts = 3;
    gradient.partial = partials(graph::most_offset_partials(), parts);
    const int rows = graph::sum_gradients(gradient, nullptr);
    const auto columns = static_cast<int32_t>(w_grad.size(1));
    products_.add({.rows = rows,
                   .partial = gradient.partial,
                   .parts = parts,
                   .out = f32(w_grad) + columns - parts,
                   .stride = columns});
  }

  /// The same of the offsets between cells and their parents, sign (1/2 - bits), for rows of cells.
  void octants_backward(const DeviceLevel& level, const uint16_t* d, float sign, const at::Tensor& w_grad);

  graph::HgnConfig config_;
  std::map<std::string, Fcn> fcns_;
  std::map<std::string, Fcn::Layer> gathers_;
  at::TensorOptions number_, half_;
  at::Tensor embedding_, embedding_grad_;
  graph::PackedNetwork packed_;
  graph::WeightProducts products_;
  std::vector<at::Tensor> kept_;  ///< what launches of this step read and write

 private:
  graph::NetworkGraph graph_of(const DeviceBatch& batch);

  float* decoder_backward(int64_t particles, const at::Tensor& grad);

  uint16_t* before_decoder_ = nullptr;
  FcnRecord decoder_;  ///< of several frames at once, by libtorch
};

}  // namespace graupel::train
