// The first layer is evaluated as W_x X + (W_z (q, mu) + b): one product for the points of a batch and one for its
// snapshots, added row by row, instead of one for all pairs. Backward passes write straight into the flat gradient, as
// in hgn_layers.h.
#include "train/mlp_module.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/elu.h>
#include <ATen/ops/elu_backward.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/norm.h>
#include <ATen/ops/sum.h>
#include <ATen/ops/zeros.h>
#include <ATen/ops/zeros_like.h>

#include <array>
#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "rom/conv_encoder.h"
#include "train/graph_kernels.h"

namespace graupel::train {

namespace {

using rom::ConvEncoder;
using rom::Mlp;

constexpr int64_t alignment = 64;  ///< of parameters in the flat arrays, in numbers

struct FlatParameter {
  std::string name;
  std::vector<int64_t> shape;
  int64_t begin = 0, count = 0;
  int64_t fan_in = 0, fan_out = 0;  ///< 0: a bias
};

std::vector<FlatParameter> parameters_of(const MlpShape& shape) {
  std::vector<FlatParameter> list;
  const auto add = [&](const std::string& name, std::vector<int64_t> weight, int64_t fan_in, int64_t fan_out) {
    const int64_t begin =
        list.empty() ? 0 : (list.back().begin + list.back().count + alignment - 1) / alignment * alignment;
    int64_t count = 1;
    for (const int64_t extent : weight) count *= extent;
    const int64_t outputs = weight.front(), after = (begin + count + alignment - 1) / alignment * alignment;
    list.push_back({name + ".weight", std::move(weight), begin, count, fan_in, fan_out});
    list.push_back({name + ".bias", {outputs}, after, outputs, 0, 0});
  };
  for (int l = 0; l < Mlp::layer_count; ++l) {
    const int in = l == 0 ? shape.inputs() : shape.width, out = l == Mlp::hidden_layers ? shape.outputs : shape.width;
    add("layer" + std::to_string(l), {out, in}, in, out);
  }
  if (shape.encoder_particles == 0) return list;
  const std::vector<int64_t> lengths = ConvEncoder::lengths(shape.encoder_particles);
  constexpr int64_t channels = ConvEncoder::channels, kernel = ConvEncoder::kernel, hidden = ConvEncoder::hidden;
  for (std::size_t l = 0; l + 1 < lengths.size(); ++l)
    add("encoder.conv" + std::to_string(l), {channels, channels, kernel}, channels * kernel, channels * kernel);
  add("encoder.hidden", {hidden, channels * lengths.back()}, channels * lengths.back(), hidden);
  add("encoder.latent", {shape.latents, hidden}, hidden, shape.latents);
  return list;
}

/// Views of a layer's weights and of their gradients.
struct Layer {
  at::Tensor weight, bias, weight_gradient, bias_gradient;
};

at::Tensor elu_backward(const at::Tensor& gradient, const at::Tensor& result) {
  return at::elu_backward(gradient, 1, 1, 1, /*is_result=*/true, result);
}

/// The rows of a batch on the device: numbers of snapshots [k] and points [m].
struct DeviceRows {
  at::Tensor snapshots, points;
};

/// What the backward pass needs.
struct Record {
  at::Tensor points, states;       ///< of the batch [m, 3], [k, q + mu]
  std::vector<at::Tensor> hidden;  ///< activated, [k m, width]
  std::vector<at::Tensor> signal;  ///< of the encoder: input of every convolution, then of the hidden layer
  at::Tensor encoded;              ///< of the encoder: activated hidden layer
};

}  // namespace

const char* name_of(MlpArray array) {
  switch (array) {
    case MlpArray::weights:
      return "weights";
    case MlpArray::adam_m:
      return "adam_m";
    case MlpArray::adam_v:
      return "adam_v";
  }
  return "?";
}

struct MlpModule::Impl {
  Impl(const MlpShape& s, Device where, uint64_t seed, NumberType number)
      : shape(s),
        parameters(parameters_of(s)),
        device(where),
        options(at::TensorOptions()
                    .device(where == Device::cuda ? at::kCUDA : at::kCPU)
                    .dtype(number == NumberType::f64 ? at::kDouble : at::kFloat)) {
    const int64_t size = parameters.back().begin + parameters.back().count;
    for (at::Tensor& array : arrays) array = at::zeros({size}, options);
    gradient = at::zeros({size}, options);
    average = at::zeros({size}, options);
    loss_sum = at::zeros({}, options);
    points = at::zeros({1, shape.coordinates}, options);
    for (int l = 0; l < Mlp::layer_count; ++l) layers.push_back(layer("layer" + std::to_string(l)));
    if (shape.encoder_particles > 0) {
      const std::size_t count = ConvEncoder::lengths(shape.encoder_particles).size() - 1;
      for (std::size_t l = 0; l < count; ++l) convolutions.push_back(layer("encoder.conv" + std::to_string(l)));
      encoder_hidden = layer("encoder.hidden");
      encoder_latent = layer("encoder.latent");
    }
    initialize(seed);
  }

  at::Tensor& get(MlpArray array) { return arrays[static_cast<std::size_t>(array)]; }

  at::Tensor view(const std::string& name, const at::Tensor& flat) const {
    for (const FlatParameter& p : parameters)
      if (p.name == name) return flat.narrow(0, p.begin, p.count).view(p.shape);
    throw std::logic_error("MlpModule: no parameter " + name);
  }
  Layer layer(const std::string& name) {
    const at::Tensor& weights = get(MlpArray::weights);
    return {view(name + ".weight", weights), view(name + ".bias", weights), view(name + ".weight", gradient),
            view(name + ".bias", gradient)};
  }

  /// Glorot and Bengio 2010: uniform within sqrt(6 / (in + out)).
  void initialize(uint64_t seed) {
    const Random random(seed, RandomPurpose::weight_init, static_cast<uint64_t>(shape.outputs));
    std::vector<float> values(static_cast<std::size_t>(gradient.numel()), 0.0f);
    for (const FlatParameter& p : parameters) {
      if (p.fan_in == 0) continue;
      const double bound = std::sqrt(6.0 / static_cast<double>(p.fan_in + p.fan_out));
      for (int64_t i = p.begin; i < p.begin + p.count; ++i)
        values[static_cast<std::size_t>(i)] =
            static_cast<float>(random.uniform(static_cast<uint64_t>(i), 0, -bound, bound));
    }
    get(MlpArray::weights).copy_(host(values, {gradient.numel()}));
  }

  /// The caller's memory as a tensor.
  template <typename T>
  static at::Tensor host(const std::vector<T>& values, std::vector<int64_t> sizes) {
    return at::from_blob(const_cast<T*>(values.data()), sizes,
                         at::TensorOptions().dtype(std::is_same_v<T, int64_t> ? at::kLong : at::kFloat));
  }
  at::Tensor to_device(const std::vector<float>& values, std::vector<int64_t> sizes) const {
    return host(values, std::move(sizes))
        .to(options.device(), c10::typeMetaToScalarType(options.dtype()),
            /*non_blocking=*/false, /*copy=*/true);
  }

  /// One copy, asynchronous on a GPU.
  DeviceRows upload(const MlpBatch& batch) const {
    std::vector<int64_t> numbers = batch.snapshots;
    numbers.insert(numbers.end(), batch.points.begin(), batch.points.end());
    const auto k = static_cast<int64_t>(batch.snapshots.size()), m = static_cast<int64_t>(batch.points.size());
    const at::Tensor all = host(numbers, {k + m});
    const at::Tensor there =
        device == Device::cpu ? all.clone() : all.pin_memory().to(options.device(), /*non_blocking=*/true);
    return {there.narrow(0, 0, k), there.narrow(0, k, m)};
  }

  /// What a convolution of the encoder reads for each of its places, [k * places, channels * kernel]: it is a matrix
  /// product then. (The libraries' own convolution fails beside other versions of the C++ library.)
  static at::Tensor windows(const at::Tensor& x) {
    return x.unfold(2, ConvEncoder::kernel, ConvEncoder::stride)
        .permute({0, 2, 1, 3})
        .reshape({-1, ConvEncoder::channels * ConvEncoder::kernel});
  }
  static at::Tensor convolve(const Layer& layer, const at::Tensor& x) {
    const at::Tensor y = at::addmm(layer.bias, windows(x), layer.weight.reshape({ConvEncoder::channels, -1}).t());
    return y.reshape({x.size(0), -1, ConvEncoder::channels}).transpose(1, 2);
  }
  /// Fills the gradients of the weights; gradient with respect to x where it is asked for.
  static at::Tensor convolution_backward(const Layer& layer, const at::Tensor& x, const at::Tensor& grad,
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

  at::Tensor encode(const at::Tensor& snapshots, Record* record) const {
    const int64_t k = snapshots.size(0);
    at::Tensor x = at::index_select(positions, 0, snapshots);
    for (const Layer& c : convolutions) {
      if (record) record->signal.push_back(x);
      x = at::elu(convolve(c, x));
    }
    x = x.reshape({k, -1});
    if (record) record->signal.push_back(x);
    x = at::elu(at::addmm(encoder_hidden.bias, x, encoder_hidden.weight.t()));
    if (record) record->encoded = x;
    return at::addmm(encoder_latent.bias, x, encoder_latent.weight.t());
  }

  void encode_backward(const Record& record, const at::Tensor& latent_gradient) {
    const auto linear_backward = [](const Layer& layer, const at::Tensor& input, const at::Tensor& grad) {
      at::mm_out(const_cast<at::Tensor&>(layer.weight_gradient), grad.t(), input);
      layer.bias_gradient.copy_(at::sum(grad, 0));
      return at::mm(grad, layer.weight);
    };
    at::Tensor grad = elu_backward(linear_backward(encoder_latent, record.encoded, latent_gradient), record.encoded);
    const at::Tensor& flat = record.signal.back();
    grad = linear_backward(encoder_hidden, flat, grad);
    at::Tensor result = flat;  // of the last convolution, activated
    for (std::size_t l = convolutions.size(); l-- > 0;) {
      const at::Tensor& input = record.signal[l];
      const int64_t k = input.size(0);
      grad = elu_backward(grad.reshape({k, ConvEncoder::channels, -1}), result.reshape({k, ConvEncoder::channels, -1}));
      grad = convolution_backward(convolutions[l], input, grad, l > 0);
      result = input;
    }
  }

  /// Of the first layer's weights.
  at::Tensor state_columns(const at::Tensor& w) const {
    return w.narrow(1, shape.coordinates, w.size(1) - shape.coordinates);
  }

  /// The targets' prediction from the outputs [rows, outputs], y_k = sum_j M_kj q'_j where there are rates.
  at::Tensor times_rates(const at::Tensor& outputs, const DeviceRows& rows) const {
    if (shape.rates == 0) return outputs;
    const at::Tensor rate = at::index_select(rates, 0, rows.snapshots).unsqueeze(1);
    return at::sum(outputs.view({-1, shape.targets(), shape.rates}) * rate, 2);
  }
  /// The gradient with respect to the outputs from that with respect to the prediction.
  at::Tensor times_rates_backward(const at::Tensor& grad, const DeviceRows& rows) const {
    if (shape.rates == 0) return grad;
    const at::Tensor rate = at::index_select(rates, 0, rows.snapshots).unsqueeze(1);
    return (grad.unsqueeze(2) * rate).view({-1, shape.outputs});
  }

  at::Tensor forward(const DeviceRows& rows, Record* record) const {
    const int64_t k = rows.snapshots.size(0), m = rows.points.size(0);
    const at::Tensor x = at::index_select(points, 0, rows.points);
    const at::Tensor z =
        shape.encoder_particles > 0 ? encode(rows.snapshots, record) : at::index_select(states, 0, rows.snapshots);
    const at::Tensor &w = layers[0].weight, by_point = at::mm(x, w.narrow(1, 0, shape.coordinates).t()),
                     by_state = at::addmm(layers[0].bias, z, state_columns(w).t());
    at::Tensor h = (by_state.unsqueeze(1) + by_point.unsqueeze(0)).view({k * m, -1});
    at::elu_(h);
    if (record) {
      record->points = x;
      record->states = z;
      record->hidden.push_back(h);
    }
    for (std::size_t l = 1; l < layers.size(); ++l) {
      h = at::addmm(layers[l].bias, h, layers[l].weight.t());
      if (l + 1 == layers.size()) break;
      at::elu_(h);
      if (record) record->hidden.push_back(h);
    }
    return h;
  }

  void backward(const Record& record, at::Tensor grad) {
    for (std::size_t l = layers.size(); l-- > 1;) {
      const at::Tensor& h = record.hidden[l - 1];
      at::mm_out(layers[l].weight_gradient, grad.t(), h);
      layers[l].bias_gradient.copy_(at::sum(grad, 0));
      grad = elu_backward(at::mm(grad, layers[l].weight), h);
    }
    const int64_t k = record.states.size(0), m = record.points.size(0);
    grad = grad.view({k, m, -1});
    const at::Tensor by_state = at::sum(grad, 1), by_point = at::sum(grad, 0);
    const at::Tensor& w = layers[0].weight_gradient;
    w.narrow(1, 0, shape.coordinates).copy_(at::mm(by_point.t(), record.points));
    state_columns(w).copy_(at::mm(by_state.t(), record.states));
    layers[0].bias_gradient.copy_(at::sum(by_state, 0));
    if (shape.encoder_particles > 0)
      encode_backward(record, at::mm(by_state, layers[0].weight.narrow(1, shape.coordinates, shape.latents)));
  }

  /// `rows` are on the device, the targets perhaps not.
  at::Tensor targets_of(const MlpBatch& batch, const DeviceRows& rows) const {
    const auto k = static_cast<int64_t>(batch.snapshots.size()), m = static_cast<int64_t>(batch.points.size());
    const auto select = [&](const at::Tensor& snapshot, const at::Tensor& point) {
      const at::Tensor number = snapshot.view({k, 1}) * points.size(0) + point.view({1, m});
      return at::index_select(targets, 0, number.view({k * m}));
    };
    if (targets.device().type() == options.device().type()) return select(rows.snapshots, rows.points);
    return select(host(batch.snapshots, {k}), host(batch.points, {m})).to(options.device());
  }

  /// Mean of squares, on the device; its gradient in `gradient`.
  at::Tensor forward_backward(const MlpBatch& batch) {
    const DeviceRows rows = upload(batch);
    Record record;
    const at::Tensor difference = times_rates(forward(rows, &record), rows) - targets_of(batch, rows);
    const auto count = static_cast<double>(difference.numel());
    backward(record, times_rates_backward(difference * (2 / count), rows));
    return at::sum(difference * difference) / count;
  }

  /// Without clipping, the kernel asks the norm only whether it is finite; the loss tells that too.
  template <typename T>
  void adam(const AdamSettings& settings) {
    adam_step<T>(device, gradient.numel(), settings, gradient.data_ptr<T>(), loss.data_ptr<T>(),
                 get(MlpArray::weights).data_ptr<T>(), get(MlpArray::adam_m).data_ptr<T>(),
                 get(MlpArray::adam_v).data_ptr<T>(), average.data_ptr<T>());
  }

  nn::Weights named(const at::Tensor& flat) const {
    const at::Tensor values = flat.to(at::kCPU, at::kFloat).contiguous();
    nn::Weights weights;
    for (const FlatParameter& p : parameters) {
      const float* begin = values.data_ptr<float>() + p.begin;
      weights.tensors[p.name] = nn::Tensor::from_float({begin, begin + p.count}, p.shape);
    }
    return weights;
  }

  MlpShape shape;
  std::vector<FlatParameter> parameters;
  Device device;
  at::TensorOptions options;
  std::array<at::Tensor, 3> arrays;
  at::Tensor gradient, average;  ///< `average`: adam_step's moving average, which nothing reads
  at::Tensor loss, loss_sum;
  int64_t steps_in_loss = 0;
  std::vector<Layer> layers, convolutions;
  Layer encoder_hidden, encoder_latent;
  at::Tensor points, states, rates, targets, positions;
};

MlpModule::MlpModule(const MlpShape& shape, Device device, uint64_t seed, NumberType number) {
  const at::NoGradGuard no_grad;
  if (device == Device::cuda && !torch_has_cuda())
    throw ConfigError("device 'cuda' is not usable (libtorch " + torch_version() +
                      " was built without CUDA). Build against a CUDA libtorch, or use --device cpu");
  impl_ = std::make_unique<Impl>(shape, device, seed, number);
}
MlpModule::~MlpModule() = default;
MlpModule::MlpModule(MlpModule&&) noexcept = default;

void MlpModule::set_points(const std::vector<float>& points) {
  impl_->points = impl_->to_device(points, {static_cast<int64_t>(points.size()) / 3, 3});
}

void MlpModule::set_states(const std::vector<float>& states) {
  const int64_t width = impl_->shape.latents + impl_->shape.parameters;
  impl_->states = impl_->to_device(states, {static_cast<int64_t>(states.size()) / width, width});
}

void MlpModule::set_rates(const std::vector<float>& rates) {
  const int64_t width = impl_->shape.rates;
  impl_->rates = impl_->to_device(rates, {static_cast<int64_t>(rates.size()) / width, width});
}

void MlpModule::set_targets(const std::vector<float>& targets, double limit) {
  const int64_t width = impl_->shape.targets(), rows = static_cast<int64_t>(targets.size()) / width;
  const bool fits = static_cast<double>(targets.size() * sizeof(float)) <= limit;
  const at::Tensor values = Impl::host(targets, {rows, width});
  const auto dtype = c10::typeMetaToScalarType(impl_->options.dtype());
  impl_->targets = values.to(fits ? impl_->options.device() : c10::Device(at::kCPU), dtype, /*non_blocking=*/false,
                             /*copy=*/true);
}

void MlpModule::set_encoder_positions(const std::vector<float>& positions) {
  const int64_t n = impl_->shape.encoder_particles;
  impl_->positions = impl_->to_device(positions, {static_cast<int64_t>(positions.size()) / (3 * n), 3, n});
}

void MlpModule::train_step(const MlpBatch& batch, double learning_rate, int64_t step) {
  const at::NoGradGuard no_grad;
  impl_->loss = impl_->forward_backward(batch);
  AdamSettings adam;
  adam.learning_rate = learning_rate;
  adam.correction1 = 1 - std::pow(adam.beta1, static_cast<double>(step));
  adam.correction2 = 1 - std::pow(adam.beta2, static_cast<double>(step));
  if (impl_->options.dtype() == at::kDouble)
    impl_->adam<double>(adam);
  else
    impl_->adam<float>(adam);
  impl_->loss_sum.add_(impl_->loss);
  ++impl_->steps_in_loss;
}

double MlpModule::take_loss() {
  const at::NoGradGuard no_grad;
  const double sum = impl_->loss_sum.item().toDouble();
  const auto steps = static_cast<double>(std::max<int64_t>(1, impl_->steps_in_loss));
  impl_->loss_sum.zero_();
  impl_->steps_in_loss = 0;
  return sum / steps;
}

MlpModule::Squares MlpModule::squares(const MlpBatch& batch) const {
  const at::NoGradGuard no_grad;
  const DeviceRows rows = impl_->upload(batch);
  const at::Tensor target = impl_->targets_of(batch, rows),
                   difference = impl_->times_rates(impl_->forward(rows, nullptr), rows) - target;
  return {at::sum(difference * difference).item().toDouble(), at::sum(target * target).item().toDouble()};
}

std::vector<double> MlpModule::predict(const MlpBatch& batch) const {
  const at::NoGradGuard no_grad;
  const DeviceRows rows = impl_->upload(batch);
  const at::Tensor values =
      impl_->times_rates(impl_->forward(rows, nullptr), rows).to(at::kCPU, at::kDouble).contiguous();
  return {values.data_ptr<double>(), values.data_ptr<double>() + values.numel()};
}

std::vector<double> MlpModule::encode(const std::vector<int64_t>& snapshots) const {
  const at::NoGradGuard no_grad;
  const at::Tensor values =
      impl_->encode(impl_->upload({snapshots, {}}).snapshots, nullptr).to(at::kCPU, at::kDouble).contiguous();
  return {values.data_ptr<double>(), values.data_ptr<double>() + values.numel()};
}

double MlpModule::loss_and_gradient(const MlpBatch& batch, nn::Weights* gradient) {
  const at::NoGradGuard no_grad;
  const double loss = impl_->forward_backward(batch).item().toDouble();
  if (gradient) *gradient = impl_->named(impl_->gradient);
  return loss;
}

nn::Weights MlpModule::state(MlpArray array) const { return impl_->named(impl_->get(array)); }

void MlpModule::set_state(MlpArray array, const nn::Weights& weights) {
  const at::NoGradGuard no_grad;
  for (const FlatParameter& p : impl_->parameters)
    impl_->get(array).narrow(0, p.begin, p.count).copy_(Impl::host(weights.get(p.name, p.shape), {p.count}));
}

}  // namespace graupel::train
