#include "train/reduced/mlp/encoder_layers.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/elu.h>
#include <ATen/ops/elu_backward.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/sum.h>
#include <ATen/ops/zeros_like.h>

#include <utility>

#include "rom/networks/conv_encoder.h"

namespace graupel::train {

using rom::ConvEncoder;

namespace {

/// What a convolution reads for each of its places, [k * places, channels * kernel]: it is a matrix product then. (The
/// libraries' own convolution fails beside other versions of the C++ library.)
at::Tensor windows(const at::Tensor& x) {
  return x.unfold(2, ConvEncoder::kernel, ConvEncoder::stride)
      .permute({0, 2, 1, 3})
      .reshape({-1, ConvEncoder::channels * ConvEncoder::kernel});
}

at::Tensor convolve(const LinearLayer& layer, const at::Tensor& x) {
  const at::Tensor y = at::addmm(layer.bias, windows(x), layer.weight.reshape({ConvEncoder::channels, -1}).t());
  return y.reshape({x.size(0), -1, ConvEncoder::channels}).transpose(1, 2);
}

/// Fills the gradients of the weights; gradient with respect to x where it is asked for.
at::Tensor convolution_backward(const LinearLayer& layer, const at::Tensor& x, const at::Tensor& grad,
                                bool with_input) {
  const int64_t places = grad.size(2);
  const at::Tensor rows = grad.transpose(1, 2).reshape({-1, ConvEncoder::channels});
  layer.weight_gradient.copy_(at::mm(rows.t(), windows(x)).reshape(layer.weight.sizes()));
  layer.bias_gradient.copy_(at::sum(rows, 0));
  if (!with_input) return {};
  const at::Tensor to_windows = at::mm(rows, layer.weight.reshape({ConvEncoder::channels, -1}))
                                    .reshape({x.size(0), places, ConvEncoder::channels, ConvEncoder::kernel});
  at::Tensor to_input = at::zeros_like(x);
  for (int64_t j = 0; j < ConvEncoder::kernel; ++j)
    to_input.slice(2, j, j + ConvEncoder::stride * (places - 1) + 1, ConvEncoder::stride)
        .add_(to_windows.select(3, j).transpose(1, 2));
  return to_input;
}

at::Tensor linear_backward(const LinearLayer& layer, const at::Tensor& input, const at::Tensor& grad) {
  at::mm_out(const_cast<at::Tensor&>(layer.weight_gradient), grad.t(), input);
  layer.bias_gradient.copy_(at::sum(grad, 0));
  return at::mm(grad, layer.weight);
}

}  // namespace

at::Tensor elu_backward(const at::Tensor& gradient, const at::Tensor& result) {
  return at::elu_backward(gradient, 1, 1, 1, /*is_result=*/true, result);
}

EncoderLayers::EncoderLayers(std::vector<LinearLayer> convolutions, LinearLayer hidden, LinearLayer latent)
    : convolutions_(std::move(convolutions)), hidden_(std::move(hidden)), latent_(std::move(latent)) {}

at::Tensor EncoderLayers::forward(const at::Tensor& positions, EncoderRecord* record) const {
  at::Tensor x = positions;
  for (const LinearLayer& c : convolutions_) {
    if (record) record->signal.push_back(x);
    x = at::elu(convolve(c, x));
  }
  x = x.reshape({positions.size(0), -1});
  if (record) record->signal.push_back(x);
  x = at::elu(at::addmm(hidden_.bias, x, hidden_.weight.t()));
  if (record) record->encoded = x;
  return at::addmm(latent_.bias, x, latent_.weight.t());
}

void EncoderLayers::backward(const EncoderRecord& record, const at::Tensor& latent_gradient) const {
  at::Tensor grad = elu_backward(linear_backward(latent_, record.encoded, latent_gradient), record.encoded);
  const at::Tensor& flat = record.signal.back();
  grad = linear_backward(hidden_, flat, grad);
  at::Tensor result = flat;  // of the last convolution, activated
  for (std::size_t l = convolutions_.size(); l-- > 0;) {
    const at::Tensor& input = record.signal[l];
    const int64_t k = input.size(0);
    grad = elu_backward(grad.reshape({k, ConvEncoder::channels, -1}), result.reshape({k, ConvEncoder::channels, -1}));
    grad = convolution_backward(convolutions_[l], input, grad, l > 0);
    result = input;
  }
}

}  // namespace graupel::train
