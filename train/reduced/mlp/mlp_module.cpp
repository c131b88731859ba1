// The first layer is evaluated as W_x X + (W_z (q, mu) + b): one product for the points of a batch and one for its
// snapshots, added row by row, instead of one for all pairs. Backward passes write straight into the flat gradient, as
// in torch_layers.h.
#include "train/reduced/mlp/mlp_module.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/elu.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/sum.h>
#include <ATen/ops/zeros.h>

#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "core/system/error.h"
#include "rom/networks/conv_encoder.h"
#include "train/networks/graph_kernels.h"
#include "train/reduced/mlp/encoder_layers.h"
#include "train/reduced/mlp/mlp_parameters.h"
#include "train/reduced/mlp/tangent_layers.h"

namespace graupel::train {

namespace {

/// The rows of a batch on the device: numbers of snapshots [k] and points [m].
struct DeviceRows {
  at::Tensor snapshots, points;
};

/// What the backward pass needs.
struct Record {
  at::Tensor points, states;       ///< of the batch [m, 3], [k, q + mu]
  std::vector<at::Tensor> hidden;  ///< activated, [k m, width]
  EncoderRecord encoder;
  TangentRecord tangents;
};

/// What differs from step to step, in the same place of the device as long as the batches have the same size.
struct StepInput {
  int64_t snapshots = 0, points = 0;  ///< of the batch
  at::Tensor numbers;                 ///< of both, then the bits of Adam's learning rate and corrections, f64
  at::Tensor targets;                 ///< of the batch, where the training's lie in the host's memory
};

}  // namespace

struct MlpModule::Impl {
  Impl(const MlpShape& s, Device where, uint64_t seed, NumberType number, StepLaunch launch)
      : shape(s),
        parameters(mlp_parameters(s)),
        device(where),
        options(at::TensorOptions()
                    .device(where == Device::cuda ? at::kCUDA : at::kCPU)
                    .dtype(number == NumberType::f64 ? at::kDouble : at::kFloat)),
        captured(where == Device::cuda ? launch : StepLaunch::eager) {
    const int64_t size = flat_size(parameters);
    for (at::Tensor& array : arrays) array = at::zeros({size}, options);
    gradient = at::zeros({size}, options);
    average = at::zeros({size}, options);
    loss_sum = at::zeros({}, options);
    points = at::zeros({1, shape.coordinates}, options);
    for (int l = 0; l < rom::Mlp::layer_count; ++l) layers.push_back(layer("layer" + std::to_string(l)));
    if (shape.encoder_particles > 0) {
      const std::size_t count = rom::ConvEncoder::lengths(shape.encoder_particles).size() - 1;
      std::vector<LinearLayer> convolutions;
      for (std::size_t l = 0; l < count; ++l) convolutions.push_back(layer("encoder.conv" + std::to_string(l)));
      encoder.emplace(std::move(convolutions), layer("encoder.hidden"), layer("encoder.latent"));
    }
    get(MlpArray::weights).copy_(host(xavier_values(parameters, shape, seed), {size}));
  }

  at::Tensor& get(MlpArray array) { return arrays[static_cast<std::size_t>(array)]; }

  at::Tensor view(const std::string& name, const at::Tensor& flat) const {
    for (const MlpParameter& p : parameters)
      if (p.name == name) return flat.narrow(0, p.begin, p.count).view(p.shape);
    throw std::logic_error("MlpModule: no parameter " + name);
  }
  LinearLayer layer(const std::string& name) {
    const at::Tensor& weights = get(MlpArray::weights);
    return {view(name + ".weight", weights), view(name + ".bias", weights), view(name + ".weight", gradient),
            view(name + ".bias", gradient)};
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

  /// Other data of the training.
  void replace(at::Tensor& data, at::Tensor now) {
    data = std::move(now);
    captured.forget();
  }

  /// The numbers of a batch: snapshots, then points.
  static std::vector<int64_t> numbers_of(const MlpBatch& batch) {
    std::vector<int64_t> numbers = batch.snapshots;
    numbers.insert(numbers.end(), batch.points.begin(), batch.points.end());
    return numbers;
  }
  static DeviceRows rows_in(const at::Tensor& numbers, const MlpBatch& batch) {
    const auto k = static_cast<int64_t>(batch.snapshots.size()), m = static_cast<int64_t>(batch.points.size());
    return {numbers.narrow(0, 0, k), numbers.narrow(0, k, m)};
  }
  /// One copy, asynchronous on a GPU: libtorch keeps the pinned memory until it has been read.
  void copy_over(const std::vector<int64_t>& numbers, const at::Tensor& there) const {
    const at::Tensor here = host(numbers, {static_cast<int64_t>(numbers.size())});
    there.copy_(device == Device::cpu ? here : here.pin_memory(), /*non_blocking=*/true);
  }
  at::Tensor room_for(const std::vector<int64_t>& numbers) const {
    return at::empty({static_cast<int64_t>(numbers.size())}, options.dtype(at::kLong));
  }
  DeviceRows upload(const MlpBatch& batch) const {
    const std::vector<int64_t> numbers = numbers_of(batch);
    const at::Tensor there = room_for(numbers);
    copy_over(numbers, there);
    return rows_in(there, batch);
  }

  at::Tensor encode(const at::Tensor& snapshots, Record* record) const {
    return encoder->forward(at::index_select(positions, 0, snapshots), record ? &record->encoder : nullptr);
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

  at::Tensor forward_tangents(const DeviceRows& rows, TangentRecord& record) const {
    record.points = at::index_select(points, 0, rows.points);
    record.states = at::index_select(states, 0, rows.snapshots);
    record.rates = at::index_select(rates, 0, rows.snapshots);
    return tangents_forward(layers, record).permute({1, 0, 2}).reshape({-1, shape.targets()});
  }

  /// The targets' prediction, [rows, targets].
  at::Tensor predicted(const DeviceRows& rows, Record* record) const {
    if (!shape.tangents) return times_rates(forward(rows, record), rows);
    TangentRecord unused;
    return forward_tangents(rows, record ? record->tangents : unused);
  }
  /// Fills the gradient from that with respect to the prediction.
  void predicted_backward(const Record& record, const at::Tensor& grad, const DeviceRows& rows) {
    if (shape.tangents)
      tangents_backward(layers, record.tangents,
                        grad.view({-1, tangent_streams, shape.outputs}).permute({1, 0, 2}).contiguous());
    else
      backward(record, times_rates_backward(grad, rows));
  }

  at::Tensor forward(const DeviceRows& rows, Record* record) const {
    const int64_t k = rows.snapshots.size(0), m = rows.points.size(0);
    const at::Tensor x = at::index_select(points, 0, rows.points);
    const at::Tensor z = encoder ? encode(rows.snapshots, record) : at::index_select(states, 0, rows.snapshots);
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
    if (encoder)
      encoder->backward(record.encoder, at::mm(by_state, layers[0].weight.narrow(1, shape.coordinates, shape.latents)));
  }

  bool targets_on_device() const { return targets.device().type() == options.device().type(); }
  /// Rows of the targets, where they lie.
  at::Tensor select_targets(const DeviceRows& rows) const {
    const int64_t k = rows.snapshots.size(0), m = rows.points.size(0);
    const at::Tensor number = rows.snapshots.view({k, 1}) * points.size(0) + rows.points.view({1, m});
    return at::index_select(targets, 0, number.view({k * m}));
  }
  /// On the host.
  at::Tensor host_targets(const MlpBatch& batch) const {
    return select_targets({host(batch.snapshots, {static_cast<int64_t>(batch.snapshots.size())}),
                           host(batch.points, {static_cast<int64_t>(batch.points.size())})});
  }
  /// On the device.
  at::Tensor targets_of(const MlpBatch& batch, const DeviceRows& rows) const {
    return targets_on_device() ? select_targets(rows) : host_targets(batch).to(options.device());
  }

  /// Mean of squares, on the device; its gradient in `gradient`.
  at::Tensor forward_backward(const DeviceRows& rows, const at::Tensor& target) {
    Record record;
    const at::Tensor difference = predicted(rows, &record) - target;
    const auto count = static_cast<double>(difference.numel());
    const at::Tensor weighted = loss_weights.defined() ? difference * loss_weights : difference;
    predicted_backward(record, weighted * (2 / count), rows);
    return at::sum(weighted * difference) / count;
  }

  /// Writes `input`; sizes that it does not have need another place, so that the recorded step is no longer good.
  void set_input(const MlpBatch& batch, double learning_rate, int64_t step) {
    const AdamSettings adam;
    std::vector<int64_t> numbers = numbers_of(batch);
    for (const double scalar : {learning_rate, 1 - std::pow(adam.beta1, static_cast<double>(step)),
                                1 - std::pow(adam.beta2, static_cast<double>(step))})
      numbers.push_back(std::bit_cast<int64_t>(scalar));
    const auto k = static_cast<int64_t>(batch.snapshots.size()), m = static_cast<int64_t>(batch.points.size());
    if (input.snapshots != k || input.points != m) {
      captured.forget();
      input = {k, m, room_for(numbers), {}};
    }
    copy_over(numbers, input.numbers);
    if (targets_on_device()) return;
    if (!input.targets.defined()) input.targets = at::empty({k * m, targets.size(1)}, options);
    input.targets.copy_(host_targets(batch));
  }

  /// A step of the training on what `input` holds.
  void step() {
    const DeviceRows rows{input.numbers.narrow(0, 0, input.snapshots),
                          input.numbers.narrow(0, input.snapshots, input.points)};
    loss = forward_backward(rows, targets_on_device() ? select_targets(rows) : input.targets);
    if (options.dtype() == at::kDouble)
      adam<double>();
    else
      adam<float>();
    loss_sum.add_(loss);
  }

  /// Without clipping, the kernel asks the norm only whether it is finite; the loss tells that too.
  template <typename T>
  void adam() {
    AdamSettings settings;
    settings.scheduled =
        reinterpret_cast<const double*>(input.numbers.data_ptr<int64_t>() + input.snapshots + input.points);
    adam_step<T>(device, gradient.numel(), settings, gradient.data_ptr<T>(), loss.data_ptr<T>(),
                 get(MlpArray::weights).data_ptr<T>(), get(MlpArray::adam_m).data_ptr<T>(),
                 get(MlpArray::adam_v).data_ptr<T>(), average.data_ptr<T>(), current_stream(device));
  }

  nn::Weights named(const at::Tensor& flat) const {
    const at::Tensor values = flat.to(at::kCPU, at::kFloat).contiguous();
    nn::Weights weights;
    for (const MlpParameter& p : parameters) {
      const float* begin = values.data_ptr<float>() + p.begin;
      weights.tensors[p.name] = nn::Tensor::from_float({begin, begin + p.count}, p.shape);
    }
    return weights;
  }

  MlpShape shape;
  std::vector<MlpParameter> parameters;
  Device device;
  at::TensorOptions options;
  std::array<at::Tensor, 3> arrays;
  at::Tensor gradient, average;  ///< `average`: adam_step's moving average, which nothing reads
  at::Tensor loss, loss_sum;
  int64_t steps_in_loss = 0;
  std::vector<LinearLayer> layers;
  std::optional<EncoderLayers> encoder;
  at::Tensor points, states, rates, targets, positions, loss_weights;
  StepInput input;
  CapturedStep captured;
};

MlpModule::MlpModule(const MlpShape& shape, Device device, uint64_t seed, NumberType number, StepLaunch launch) {
  const at::NoGradGuard no_grad;
  if (device == Device::cuda && !torch_has_cuda())
    throw ConfigError("device 'cuda' is not usable (libtorch " + torch_version() +
                      " was built without CUDA). Build against a CUDA libtorch, or use --device cpu");
  impl_ = std::make_unique<Impl>(shape, device, seed, number, launch);
}
MlpModule::~MlpModule() = default;
MlpModule::MlpModule(MlpModule&&) noexcept = default;

void MlpModule::set_points(const std::vector<float>& points) {
  impl_->replace(impl_->points, impl_->to_device(points, {static_cast<int64_t>(points.size()) / 3, 3}));
}

void MlpModule::set_states(const std::vector<float>& states) {
  const int64_t width = impl_->shape.latents + impl_->shape.parameters;
  impl_->replace(impl_->states, impl_->to_device(states, {static_cast<int64_t>(states.size()) / width, width}));
}

void MlpModule::set_rates(const std::vector<float>& rates) {
  const int64_t width = impl_->shape.state_rates();
  impl_->replace(impl_->rates, impl_->to_device(rates, {static_cast<int64_t>(rates.size()) / width, width}));
}

void MlpModule::set_targets(const std::vector<float>& targets, double limit) {
  const int64_t width = impl_->shape.targets(), rows = static_cast<int64_t>(targets.size()) / width;
  const bool fits = static_cast<double>(targets.size() * sizeof(float)) <= limit;
  const at::Tensor values = Impl::host(targets, {rows, width});
  const auto dtype = c10::typeMetaToScalarType(impl_->options.dtype());
  impl_->replace(impl_->targets, values.to(fits ? impl_->options.device() : c10::Device(at::kCPU), dtype,
                                           /*non_blocking=*/false, /*copy=*/true));
}

void MlpModule::set_encoder_positions(const std::vector<float>& positions) {
  const int64_t n = impl_->shape.encoder_particles;
  impl_->replace(impl_->positions,
                 impl_->to_device(positions, {static_cast<int64_t>(positions.size()) / (3 * n), 3, n}));
}

void MlpModule::set_loss_weights(const std::vector<float>& weights) {
  impl_->replace(impl_->loss_weights, impl_->to_device(weights, {static_cast<int64_t>(weights.size())}));
}

void MlpModule::train_step(const MlpBatch& batch, double learning_rate, int64_t step) {
  const at::NoGradGuard no_grad;
  impl_->set_input(batch, learning_rate, step);
  impl_->captured.run([this] { impl_->step(); });
  ++impl_->steps_in_loss;
}

int64_t MlpModule::replayed_steps() const { return impl_->captured.replays(); }

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
  const at::Tensor target = impl_->targets_of(batch, rows), difference = impl_->predicted(rows, nullptr) - target;
  return {at::sum(difference * difference).item().toDouble(), at::sum(target * target).item().toDouble()};
}

std::vector<double> MlpModule::predict(const MlpBatch& batch) const {
  const at::NoGradGuard no_grad;
  const DeviceRows rows = impl_->upload(batch);
  const at::Tensor values = impl_->predicted(rows, nullptr).to(at::kCPU, at::kDouble).contiguous();
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
  const DeviceRows rows = impl_->upload(batch);
  const double loss = impl_->forward_backward(rows, impl_->targets_of(batch, rows)).item().toDouble();
  if (gradient) *gradient = impl_->named(impl_->gradient);
  return loss;
}

nn::Weights MlpModule::state(MlpArray array) const { return impl_->named(impl_->get(array)); }

void MlpModule::set_state(MlpArray array, const nn::Weights& weights) {
  const at::NoGradGuard no_grad;
  for (const MlpParameter& p : impl_->parameters)
    impl_->get(array).narrow(0, p.begin, p.count).copy_(Impl::host(weights.get(p.name, p.shape), {p.count}));
}

}  // namespace graupel::train
