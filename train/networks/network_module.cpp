#include "train/networks/network_module.h"

#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/norm.h>
#include <ATen/ops/pow.h>
#include <ATen/ops/zeros.h>
#include <c10/core/InferenceMode.h>
#include <torch/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <thread>

#include "core/system/error.h"
#include "core/system/stopwatch.h"
#include "train/networks/gpu_memory_error.h"
#include "train/networks/loss.h"
#include "train/networks/mixed_precision_network.h"
#include "train/networks/torch_engine.h"

namespace graupel::train {

const char* name_of(StateArray array) {
  switch (array) {
    case StateArray::weights:
      return "weights";
    case StateArray::ema:
      return "ema";
    case StateArray::adam_m:
      return "adam_m";
    case StateArray::adam_v:
      return "adam_v";
  }
  return "?";
}

void configure_torch(int threads, bool tf32) {
  std::thread([] {}).join();  // throws where the system gives no thread, for which libtorch's pool waits without end
  at::set_num_threads(threads);
  at::globalContext().setAllowTF32CuBLAS(tf32);
}

std::string torch_version() { return TORCH_VERSION; }
bool torch_has_cuda() { return at::hasCUDA(); }

struct NetworkModule::Impl {
  Impl(const NetworkConfig& network_config, Device where, uint64_t seed, NumberType number, int64_t checkpoint_layers)
      : config(network_config),
        layout(network_config),
        device(where),
        options(at::TensorOptions()
                    .device(where == Device::cuda ? at::kCUDA : at::kCPU)
                    .dtype(number == NumberType::f64 ? at::kDouble : at::kFloat)),
        reduced(at::zeros({layout.size() + 2}, options)),
        gradient(reduced.narrow(0, 0, layout.size())),
        means(at::zeros({2}, options)) {
    for (at::Tensor& array : arrays) array = at::zeros({layout.size()}, options);
    if (number == NumberType::mixed && device == Device::cuda)
      fused = make_mixed_precision_network(config, checkpoint_layers, layout, get(StateArray::weights), gradient);
    network = std::make_unique<TorchEngine>(layout, get(StateArray::weights), checkpoint_layers);
    average = std::make_unique<TorchEngine>(layout, get(StateArray::ema));
    const std::vector<float> initial = layout.initial_values(seed);
    fill(StateArray::weights, initial);
    fill(StateArray::ema, initial);
  }

  const TorchEngine& engine(StateArray which) const {
    GRAUPEL_ASSERT(which == StateArray::weights || which == StateArray::ema);
    return which == StateArray::weights ? *network : *average;
  }
  at::Tensor& get(StateArray array) { return arrays[static_cast<std::size_t>(array)]; }
  void fill(StateArray array, const std::vector<float>& values) {
    get(array).copy_(
        at::from_blob(const_cast<float*>(values.data()), {static_cast<int64_t>(values.size())}, at::kFloat));
  }
  std::vector<float> read(const at::Tensor& tensor) const {
    const at::Tensor host = tensor.to(at::kCPU, at::kFloat).contiguous();
    return {host.data_ptr<float>(), host.data_ptr<float>() + host.numel()};
  }
  /// Loss on the device, and its gradient in `gradient`.
  at::Tensor forward_backward(const DeviceBatch& on_device) {
    GRAUPEL_ASSERT(on_device.target.defined());
    if (fused) {
      const AccelerationLoss loss = loss_of(fused->forward(on_device), on_device);
      fused->backward(on_device, loss.gradient());
      return loss.value();
    }
    at::Tensor loss;
    network->backward(on_device, gradient, [&](const at::Tensor& accelerations) {
      const AccelerationLoss of_batch = loss_of(accelerations, on_device);
      loss = of_batch.value();
      return of_batch.gradient();
    });
    return loss;
  }
  AccelerationLoss loss_of(const at::Tensor& accelerations, const DeviceBatch& on_device) const {
    return {accelerations, on_device, features_of(config).in_plane()};
  }
  /// Loss and gradient of all ranks' shards as one batch. Both are means over particles that count, so that a shard
  /// counts by its particles: one sum over ranks of particles * [gradient, loss, 1].
  at::Tensor join_shards(Comm& comm, const at::Tensor& loss, int64_t particles) {
    if (comm.alone()) return loss;
    const int64_t n = layout.size();
    reduced.select(0, n).copy_(loss);
    reduced.select(0, n + 1).fill_(1);
    reduced.mul_(static_cast<double>(particles));
    comm.all_reduce_sum(reduced);
    reduced.div_(reduced.select(0, n + 1).clone());
    return reduced.select(0, n);
  }
  void train_step(const DeviceBatch& batch, const StepSettings& settings, Comm& comm);
  template <typename T>
  void adam(const AdamSettings& settings, const at::Tensor& norm) {
    adam_step<T>(device, layout.size(), settings, gradient.data_ptr<T>(), norm.data_ptr<T>(),
                 get(StateArray::weights).data_ptr<T>(), get(StateArray::adam_m).data_ptr<T>(),
                 get(StateArray::adam_v).data_ptr<T>(), get(StateArray::ema).data_ptr<T>());
  }

  NetworkConfig config;
  ParameterLayout layout;
  Device device;
  at::TensorOptions options;
  std::array<at::Tensor, 4> arrays;
  at::Tensor reduced;   ///< the gradient, the loss and the particles: what ranks add up
  at::Tensor gradient;  ///< part of `reduced`
  at::Tensor means;     ///< sums of loss and gradient norm since they were last taken
  int64_t steps_in_means = 0;
  at::Tensor predicted;  ///< of the last predict() on the device
  std::unique_ptr<TorchEngine> network, average;
  std::unique_ptr<MixedPrecisionNetwork> fused;  ///< takes the training steps where it is there
};

NetworkModule::NetworkModule(const NetworkConfig& config, Device device, uint64_t seed, NumberType number,
                             int64_t checkpoint_layers) {
  const at::NoGradGuard no_grad;
  if (device == Device::cuda && !torch_has_cuda())
    throw ConfigError("device 'cuda' is not usable (libtorch " + torch_version() +
                      " was built without CUDA). Build against a CUDA libtorch, or use --device cpu");
  impl_ = std::make_unique<Impl>(config, device, seed, number, checkpoint_layers);
}
NetworkModule::~NetworkModule() = default;
NetworkModule::NetworkModule(NetworkModule&&) noexcept = default;

const NetworkConfig& NetworkModule::config() const { return impl_->config; }
bool NetworkModule::is_mixed() const { return impl_->fused != nullptr; }
int64_t NetworkModule::parameter_count() const { return impl_->layout.parameter_count(); }

std::vector<float> NetworkModule::predict(const Batch& batch, StateArray which) const {
  const at::NoGradGuard no_grad;
  const TorchEngine& engine = impl_->engine(which);
  return impl_->read(engine.forward(upload(batch, engine.weights())));
}

TimedPrediction NetworkModule::time_prediction(const Batch& batch, StateArray which, graph::FirstLayers first_layers,
                                               int64_t warm_ups, int64_t runs) const {
  const c10::InferenceMode inference;
  const TorchEngine& engine = impl_->engine(which);
  const DeviceBatch on_device = upload(batch, engine.weights());
  TimedPrediction timed;
  at::Tensor prediction;
  for (int64_t run = -warm_ups; run < runs; ++run) {
    synchronize(impl_->device);
    const Stopwatch watch;
    prediction = engine.forward(on_device, first_layers);
    synchronize(impl_->device);
    if (run >= 0) timed.seconds.push_back(watch.seconds());
  }
  timed.accelerations = impl_->read(prediction);
  return timed;
}

void NetworkModule::Impl::train_step(const DeviceBatch& batch, const StepSettings& settings, Comm& comm) {
  const at::Tensor of_shard = within_gpu_memory(batch.particles, [&] { return forward_backward(batch); });
  const at::Tensor loss = join_shards(comm, of_shard, batch.particles - batch.uncounted);
  const at::Tensor norm = at::norm(gradient);
  AdamSettings rule;
  rule.learning_rate = settings.learning_rate;
  rule.beta1 = settings.beta1;
  rule.beta2 = settings.beta2;
  rule.epsilon = settings.epsilon;
  rule.correction1 = 1 - std::pow(settings.beta1, static_cast<double>(settings.step));
  rule.correction2 = 1 - std::pow(settings.beta2, static_cast<double>(settings.step));
  rule.clip = settings.clip_norm;
  rule.ema_decay = settings.ema_decay;
  if (options.dtype() == at::kDouble)
    adam<double>(rule, norm);
  else
    adam<float>(rule, norm);
  means.select(0, 0).add_(loss);
  means.select(0, 1).add_(norm);
  ++steps_in_means;
}

void NetworkModule::train_step(const Batch& batch, const StepSettings& settings, Comm& comm) {
  const at::NoGradGuard no_grad;
  impl_->train_step(upload(batch, impl_->network->weights()), settings, comm);
}

void NetworkModule::train_step(const SampleArrays& batch, const StepSettings& settings, Comm& comm) {
  const at::NoGradGuard no_grad;
  impl_->train_step(attach(batch, impl_->network->weights(), !is_mixed()), settings, comm);
}

const float* NetworkModule::predict(const SampleArrays& batch) {
  const at::NoGradGuard no_grad;
  const DeviceBatch on_device = attach(batch, impl_->network->weights(), !is_mixed());
  return within_gpu_memory(on_device.particles, [&] {
    impl_->predicted =
        is_mixed() ? impl_->fused->forward(on_device) : impl_->network->forward(on_device).to(at::kFloat);
    impl_->predicted = impl_->predicted.contiguous();
    return impl_->predicted.data_ptr<float>();
  });
}

StepMeans NetworkModule::take_means() {
  const at::NoGradGuard no_grad;
  const std::vector<float> sums = impl_->read(impl_->means);
  StepMeans means{.steps = impl_->steps_in_means};
  if (means.steps > 0) {
    means.loss = sums[0] / static_cast<double>(means.steps);
    means.gradient_norm = sums[1] / static_cast<double>(means.steps);
  }
  impl_->means.zero_();
  impl_->steps_in_means = 0;
  return means;
}

double NetworkModule::loss_and_gradient(const Batch& batch, std::vector<double>* gradient) {
  const at::NoGradGuard no_grad;
  const double loss = impl_->forward_backward(upload(batch, impl_->network->weights())).item().toDouble();
  if (gradient) {
    const at::Tensor host = impl_->gradient.to(at::kCPU, at::kDouble);
    gradient->assign(host.data_ptr<double>(), host.data_ptr<double>() + host.numel());
  }
  return loss;
}

double NetworkModule::loss(const Batch& batch) const {
  const at::NoGradGuard no_grad;
  const DeviceBatch on_device = upload(batch, impl_->network->weights());
  return impl_->loss_of(impl_->network->forward(on_device), on_device).value().item().toDouble();
}

void NetworkModule::nudge(int64_t index, double change) {
  const at::NoGradGuard no_grad;
  impl_->get(StateArray::weights).select(0, index).add_(change);
}

nn::Weights NetworkModule::state(StateArray array) const {
  return impl_->layout.to_weights(impl_->read(impl_->get(array)));
}

void NetworkModule::set_state(StateArray array, const nn::Weights& weights) {
  const at::NoGradGuard no_grad;
  impl_->fill(array, impl_->layout.from_weights(weights));
}

void NetworkModule::share_state(Comm& comm) {
  for (at::Tensor& array : impl_->arrays) comm.broadcast(array);
}

}  // namespace graupel::train
