// What the training passes of graph networks on a GPU have in common (graph/cuda/fused_mlp/row_layers.h): products in
// bf16 with f32 sums, residual sums and weights in f32. The weights are those of the network's plan. What the backward
// pass can compute anew is not kept. The function is that of TorchEngine. Latent width 128. Internal, as
// torch_layers.h.
#pragma once

#include <ATen/ops/empty.h>

#include <map>
#include <string>
#include <vector>

#include "graph/cuda/forward/packed_network.h"
#include "train/networks/mixed_precision_network.h"
#include "train/networks/torch_engine.h"

namespace graupel::train {

class FusedNetwork : public MixedPrecisionNetwork, protected graph::RowMemory {
 protected:
  static constexpr int64_t h = graph::layer_width;
  static float* f32(const at::Tensor& tensor) { return static_cast<float*>(tensor.data_ptr()); }
  static uint16_t* f16(const at::Tensor& tensor) { return static_cast<uint16_t*>(tensor.data_ptr()); }
  static const int32_t* index(const at::Tensor& tensor) {
    return tensor.defined() ? static_cast<const int32_t*>(tensor.data_ptr()) : nullptr;
  }

  FusedNetwork(const ParameterLayout& layout, const at::Tensor& flat, const at::Tensor& gradient);

  const graph::LayerPlan& plan() const { return packed_.plan(); }
  at::Tensor weight(const std::string& name) const { return view_of(*parameter_.at(name), flat_); }
  at::Tensor gradient(const std::string& name) const { return view_of(*parameter_.at(name), gradient_); }

  /// Forgets the last step, takes over the weights' present values, and gives what the networks read of a batch.
  graph::NetworkGraph begin(const DeviceBatch& batch);
  float* rows32(int64_t rows) override { return f32(kept_.emplace_back(at::empty({rows, h}, number_))); }
  uint16_t* rows16(int64_t rows) override { return f16(kept_.emplace_back(at::empty({rows, h}, half_))); }
  bool keeps_all() const override { return true; }
  /// Memory for partial sums [rows, parts, 128].
  float* partials(int64_t rows, int64_t parts) { return f32(kept_.emplace_back(at::empty({rows, parts, h}, number_))); }
  /// [rows, columns] f32 as [rows, 128] bf16.
  const uint16_t* packed(const at::Tensor& numbers);

  /// What a network's backward pass leaves for its weights' gradients, [rows, 128] each.
  struct Traces {
    uint16_t *hidden, *d_raw, *d_sum;
  };
  Traces new_traces(int64_t rows) { return {rows16(rows), rows16(rows), rows16(rows)}; }
  /// Goes back through the FCN `name` and adds the products for its W2, b2, gamma and beta.
  void back_through(const std::string& name, graph::FusedMlpGradient gradient, const Traces& traces);
  /// Gradient of columns of `matrix` ("encoder.layer1"): sum over rows of d x; `with_bias`: of its bias the sum of d.
  void add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const std::string& matrix, int64_t first_column,
                   int64_t columns, bool with_bias = false);

  /// The decoder by libtorch, of the first `particles` rows of the latents; and by autograd, from the gradient of its
  /// result, that of these latents and of its weights.
  at::Tensor decode(float* latents, int64_t particles);
  at::Tensor decoder_backward(const at::Tensor& grad);

  at::TensorOptions number_, half_;
  graph::PackedNetwork packed_;
  graph::WeightProducts products_;
  std::vector<at::Tensor> kept_;  ///< what launches of this step read and write

 private:
  ParameterLayout layout_;
  at::Tensor flat_, gradient_;
  std::map<std::string, const Parameter*> parameter_;
  TorchEngine engine_;
  at::Tensor before_decoder_, decoded_;
};

}  // namespace graupel::train
