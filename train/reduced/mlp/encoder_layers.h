// The paper's encoder (rom/networks/conv_encoder.h) in training, on libtorch tensors. Internal: only the .cpp files of
// train/ that are compiled with libtorch include this. Backward passes write straight into the flat gradient, as in
// torch_layers.h.
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

namespace graupel::train {

/// Views of a layer's weights [out, in] and biases [out] and of their gradients.
struct LinearLayer {
  at::Tensor weight, bias, weight_gradient, bias_gradient;
};

/// Gradient with respect to x from that with respect to elu(x), given `result` = elu(x).
at::Tensor elu_backward(const at::Tensor& gradient, const at::Tensor& result);

/// What the backward pass needs.
struct EncoderRecord {
  std::vector<at::Tensor> signal;  ///< input of every convolution [k, channels, places], then of the hidden layer
  at::Tensor encoded;              ///< activated hidden layer [k, hidden]
};

class EncoderLayers {
 public:
  /// Convolutions have weights [channels, channels, kernel].
  EncoderLayers(std::vector<LinearLayer> convolutions, LinearLayer hidden, LinearLayer latent);

  /// Latents [k, r] of positions [k, 3, particles]. The record may be null (inference).
  at::Tensor forward(const at::Tensor& positions, EncoderRecord* record) const;
  /// Fills the gradients of the weights from that with respect to the latents.
  void backward(const EncoderRecord& record, const at::Tensor& latent_gradient) const;

 private:
  std::vector<LinearLayer> convolutions_;
  LinearLayer hidden_, latent_;
};

}  // namespace graupel::train
