#include "tests/train/rounded_reference.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "train/networks/loss.h"
#include "train/networks/network_module.h"
#include "train/networks/torch_engine.h"

namespace graupel::train {

namespace {

using graph::End;
using graph::PlanLayer;
using Context = TorchEngine::Context;

at::Tensor to_bf16(const at::Tensor& x) { return x.to(at::kBFloat16).to(x.scalar_type()); }

/// Rounds the value, its gradient, or both.
struct Round : torch::autograd::Function<Round> {
  static at::Tensor forward(torch::autograd::AutogradContext* ctx, const at::Tensor& x, bool value, bool gradient) {
    ctx->saved_data["gradient"] = gradient;
    return value ? to_bf16(x) : x.clone();
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* ctx,
                                                 torch::autograd::variable_list g) {
    return {ctx->saved_data["gradient"].toBool() ? to_bf16(g[0]) : g[0], {}, {}};
  }
};

/// The operations of a plan with the roundings of the kernels.
class RoundedOperations {
 public:
  RoundedOperations(bool rounds, bool is_gns, bool has_decoder_kernel)
      : rounds_(rounds), is_gns_(is_gns), has_decoder_kernel_(has_decoder_kernel) {}

  void teach(TorchEngine& engine) const {
    using namespace graph::operation;
    const RoundedOperations self = *this;
    engine.add_operation(encode, [self](const Context& c) { return self.encoded(c); });
    engine.add_operation(graph::operation::gather, [self](const Context& c) { return self.gathered(c); });
    engine.add_operation(aggregate, [self](const Context& c) { return self.aggregated(c); });
    engine.add_operation(update, [self](const Context& c) { return self.updated(c); });
    engine.add_operation(add, [self](const Context& c) { return self.added(c); });
    engine.add_operation(decode, [self](const Context& c) { return self.decoded(c); });
  }

 private:
  at::Tensor value(const at::Tensor& x) const { return rounds_ ? Round::apply(x, true, false) : x; }
  at::Tensor gradient(const at::Tensor& x) const { return rounds_ ? Round::apply(x, false, true) : x; }
  at::Tensor both(const at::Tensor& x) const { return rounds_ ? Round::apply(x, true, true) : x; }

  /// The rest of an FCN behind the sum of its first layer.
  at::Tensor behind_first(const Context& c, const at::Tensor& sum) const {
    const at::Tensor hidden = value(at::leaky_relu(gradient(sum), c.layer().slope));
    const at::Tensor raw =
        gradient(at::addmm(c.parameter(".layer2.bias"), hidden, value(c.parameter(".layer2.weight")).t()));
    return at::layer_norm(raw, {raw.size(1)}, c.parameter(".norm.weight"), c.parameter(".norm.bias"), 1e-5, false);
  }

  /// The first layer in f32, of features and of a row of the embedding.
  at::Tensor encoded(const Context& c) const {
    const at::Tensor x = at::cat({c.source(0), at::mm(c.batch.type_one_hot, c.embedding())}, 1);
    return behind_first(c, at::addmm(c.parameter(".layer1.bias"), x, c.parameter(".layer1.weight").t()));
  }

  at::Tensor gathered(const Context& c) const {
    return c.layer().is_linear() ? gathered_activations(c) : gathered_messages(c);
  }

  /// FCN of links: parts of the first layer once a node, in f32.
  at::Tensor gathered_messages(const Context& c) const {
    const TorchLinks& links = c.links();
    const at::Tensor& w = c.parameter(".layer1.weight");
    at::Tensor sum = c.parameter(".layer1.bias").unsqueeze(0);
    int64_t column = 0;
    for (std::size_t i = 0; i < c.operation.sources.size(); ++i) {
      const at::Tensor& rows = c.source(i);
      const End end = c.operation.sources[i].end;
      at::Tensor part = at::mm(value(rows), value(w.narrow(1, column, rows.size(1))).t());
      column += rows.size(1);
      if (end != End::link) part = gradient(part).index_select(0, row_of(end_of(links, end), links.count));
      sum = sum + part;
    }
    if (c.operation.offset) sum = sum + at::mm(links.offset, w.narrow(1, column, 3).t());
    return behind_first(c, sum);
  }

  /// Activations of links: parts once a node, in bf16. The bias goes with the receiver's part, or the particle's; that
  /// of a restriction with the octants' offsets. A particle's part holds its own offset, what corners add is in f32.
  at::Tensor gathered_activations(const Context& c) const {
    const TorchLinks& links = c.links();
    const graph::LinkKind kind = c.operation.links.kind;
    const bool to_cell = kind == graph::LinkKind::particle_to_cell, to_parent = kind == graph::LinkKind::to_parent;
    const bool of_particles = to_cell || kind == graph::LinkKind::cell_to_particle;
    const End with_bias = to_cell || to_parent ? End::sender : End::receiver;
    const at::Tensor &w = c.parameter(".weight"), &b = c.parameter(".bias");
    const int64_t width = w.size(1) - 3;
    const at::Tensor w_offset = w.narrow(1, width, 3).t();
    at::Tensor offset = links.offset, sum = to_parent ? b.unsqueeze(0) : at::zeros({1, b.size(0)}, b.options());
    int64_t column = 0;
    for (std::size_t i = 0; i < c.operation.sources.size(); ++i) {
      const at::Tensor& rows = c.source(i);
      const End end = c.operation.sources[i].end;
      const at::Tensor node = row_of(end_of(links, end), links.count);
      at::Tensor part = at::mm(value(rows), value(w.narrow(1, column, rows.size(1))).t());
      column += rows.size(1);
      if (end == with_bias && !to_parent) part = part + b;
      if (end == with_bias && of_particles) {
        const at::Tensor own = to_cell ? at::neg(c.batch.offset) : c.batch.offset;
        part = part + at::mm(own, w_offset);
        offset = offset - own.index_select(0, node);
      }
      sum = sum + both(part).index_select(0, node);
    }
    return at::leaky_relu(sum + at::mm(offset, w_offset), c.layer().slope);
  }
  static const LinkEnd& end_of(const TorchLinks& links, End end) {
    return end == End::sender ? links.sender : links.receiver;
  }

  at::Tensor aggregated(const Context& c) const {
    const TorchLinks& links = c.links();
    at::Tensor rows = is_gns_ ? value(c.source(0)) : c.source(0);
    if (links.weight.defined()) rows = rows * links.weight.view({-1, 1});
    const int64_t nodes = count_of(c);
    const at::Tensor sums =
        at::zeros({nodes, rows.size(1)}, rows.options()).index_add(0, row_of(links.receiver, links.count), rows);
    return is_gns_ ? value(sums) : both(sums * c.operation.scale);
  }

  at::Tensor updated(const Context& c) const {
    if (c.operation.sources.size() == 1 && is_gns_) {  // the encoder of edges: features in f32, latents in bf16
      const at::Tensor sum = at::addmm(c.parameter(".layer1.bias"), c.source(0), c.parameter(".layer1.weight").t());
      return both(behind_first(c, sum));
    }
    std::vector<at::Tensor> inputs;
    for (std::size_t i = 0; i < c.operation.sources.size(); ++i) inputs.push_back(value(c.source(i)));
    return behind_first(
        c, at::addmm(c.parameter(".layer1.bias"), at::cat(inputs, 1), value(c.parameter(".layer1.weight")).t()));
  }

  /// Residual sums: of GNS those of edges, in bf16.
  at::Tensor added(const Context& c) const {
    const at::Tensor sum = c.source(0) + c.source(1);
    return is_gns_ ? both(sum) : sum;
  }

  at::Tensor decoded(const Context& c) const {
    const at::Tensor x = c.source(0).narrow(0, 0, c.batch.particles);
    const at::Tensor &w1 = c.parameter(".layer1.weight"), &b1 = c.parameter(".layer1.bias");
    const at::Tensor sum =
        has_decoder_kernel_ ? gradient(at::addmm(b1, value(x), value(w1).t())) : at::addmm(b1, x, w1.t());
    return at::addmm(c.parameter(".layer2.bias"), at::leaky_relu(sum, c.layer().slope),
                     c.parameter(".layer2.weight").t());
  }

  static at::Tensor row_of(const LinkEnd& end, int64_t links) {
    if (end.index.defined()) return end.index.to(at::kLong);
    return at::arange(links, at::kLong).__rshift__(end.shift);
  }
  /// Rows of what the operation makes.
  static int64_t count_of(const Context& c) {
    const graph::Rows rows = c.operation.links.receiver();
    if (rows.set == graph::RowSet::cells) return c.batch.level[static_cast<std::size_t>(rows.level)].cells;
    return c.batch.features.size(0);
  }

  bool rounds_, is_gns_, has_decoder_kernel_;
};

}  // namespace

RoundedReference rounded_reference(const NetworkConfig& config, uint64_t seed, const Batch& batch,
                                   const ReferenceOptions& options) {
  const at::NoGradGuard no_grad;
  const ParameterLayout layout(config);
  const std::vector<float> values = layout.initial_values(seed);
  const at::Tensor flat = at::from_blob(const_cast<float*>(values.data()), {layout.size()}, at::kFloat).to(at::kDouble);
  flat.slice(0, 0, layout.size(), 2).mul_(1 + options.disturbance);
  TorchEngine engine(layout, flat);
  const bool is_gns = std::holds_alternative<graph::GnsConfig>(config);
  const bool has_decoder_kernel = options.rounds && !is_gns && features_of(config).bundle == 1;
  RoundedOperations(options.rounds, is_gns, has_decoder_kernel).teach(engine);
  const DeviceBatch on_device = upload(batch, flat);
  const at::Tensor gradient = at::zeros_like(flat);
  RoundedReference reference;
  engine.backward(on_device, gradient, [&](const at::Tensor& accelerations) {
    const AccelerationLoss loss(accelerations, on_device, features_of(config).in_plane());
    reference.loss = loss.value().item().toDouble();
    return loss.gradient();
  });
  reference.gradient.assign(gradient.data_ptr<double>(), gradient.data_ptr<double>() + gradient.numel());
  return reference;
}

std::vector<double> relative_differences(const NetworkConfig& config, const std::vector<double>& gradient,
                                         const std::vector<double>& expected) {
  std::vector<double> relative;
  const ParameterLayout layout(config);
  for (const Parameter& parameter : layout.parameters()) {
    double difference = 0, size = 0;
    for (int64_t i = parameter.begin; i < parameter.begin + parameter.count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      difference += std::pow(gradient[at] - expected[at], 2);
      size += std::pow(expected[at], 2);
    }
    // A tensor without a gradient must have none: infinite where it has one.
    relative.push_back(difference == 0 ? 0 : std::sqrt(difference / size));
  }
  return relative;
}

void expect_gradients_near(const NetworkConfig& config, const std::vector<double>& gradient,
                           const std::vector<double>& expected, double limit, const std::vector<double>& floor) {
  ASSERT_EQ(gradient.size(), expected.size());
  const std::vector<double> difference = relative_differences(config, gradient, expected);
  const ParameterLayout layout(config);
  for (std::size_t i = 0; i < difference.size(); ++i) {
    const double own = floor.empty() ? 0 : floor[i];
    EXPECT_LE(difference[i], limit + 1.5 * own) << layout.parameters()[i].name << ", floor " << own;
  }
}

void check_mixed_gradient(const NetworkConfig& config, Batch batch) {
  for (int64_t i = 0; i < batch.target.count; ++i)
    batch.numbers[static_cast<std::size_t>(batch.target.begin + i)] += static_cast<float>(1 + i % 3);
  NetworkModule exact(config, Device::cpu, 5, NumberType::f64), mixed(config, Device::cuda, 5, NumberType::mixed);
  ASSERT_TRUE(mixed.is_mixed());
  std::vector<double> expected, gradient, again;
  const double loss = exact.loss_and_gradient(batch, &expected);
  const double found = mixed.loss_and_gradient(batch, &gradient);
  mixed.loss_and_gradient(batch, &again);
  EXPECT_EQ(gradient, again) << "sums are made in a fixed order";

  const RoundedReference rounded = rounded_reference(config, 5, batch);
  std::vector<double> floor(ParameterLayout(config).parameters().size(), 0);
  for (const double disturbance : {1e-7, 1e-6}) {
    const RoundedReference moved = rounded_reference(config, 5, batch, {.disturbance = disturbance});
    const std::vector<double> difference = relative_differences(config, moved.gradient, rounded.gradient);
    std::transform(floor.begin(), floor.end(), difference.begin(), floor.begin(),
                   [](double a, double b) { return std::max(a, b); });
  }
  const double unit = std::holds_alternative<graph::GnsConfig>(config) ? 5e-4 : 3e-4;
  EXPECT_NEAR(found, loss, 10 * unit * loss);
  EXPECT_NEAR(found, rounded.loss, unit * loss);
  expect_gradients_near(config, gradient, rounded.gradient, 0.03, floor);
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    difference += std::pow(gradient[i] - expected[i], 2);
    size += std::pow(expected[i], 2);
  }
  EXPECT_LT(std::sqrt(difference / size), 0.08);
  const std::vector<double> beside = relative_differences(config, gradient, rounded.gradient);
  std::printf("gradient beside the reference: worst tensor %.4f, its floor %.4f; largest floor %.4f\n",
              *std::max_element(beside.begin(), beside.end()),
              floor[static_cast<std::size_t>(std::max_element(beside.begin(), beside.end()) - beside.begin())],
              *std::max_element(floor.begin(), floor.end()));
}

}  // namespace graupel::train
