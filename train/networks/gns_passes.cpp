#include "train/networks/gns_passes.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/sum.h>
#include <ATen/ops/zeros.h>

#include <algorithm>

#include "core/system/error.h"
#include "graph/topology/gns_graph.h"

namespace graupel::train {

namespace {

std::string step_name(int64_t k, const char* part) { return "step." + std::to_string(k) + "." + part; }

}  // namespace

GnsPasses::GnsPasses(const graph::GnsConfig& config, int64_t checkpoint_layers, const ParameterLayout& layout,
                     const at::Tensor& flat, const at::Tensor& gradient)
    : config_(config), checkpoint_layers_(checkpoint_layers), fcns_(bind_fcns(layout, flat, gradient)) {
  const Parameter& embedding = layout.find("embedding.weight");
  embedding_ = view_of(embedding, flat);
  if (gradient.defined()) embedding_grad_ = view_of(embedding, gradient);
}

DeviceBatch GnsPasses::upload(const Batch& batch) const {
  GRAUPEL_ASSERT(batch.level.size() == 1);
  const UploadedBatch uploaded(batch, embedding_);
  DeviceBatch on_device = uploaded.particles(batch);
  on_device.level.push_back(uploaded.links(batch.level.front(), batch.edge_features));
  return on_device;
}

DeviceBatch GnsPasses::attach(const SampleArrays& arrays, bool) const {
  DeviceBatch batch;
  batch.particles = arrays.particles;
  batch.held = arrays.held;
  batch.features = attached(arrays.features, arrays.rows, arrays.feature_width, embedding_);
  batch.target = attached(arrays.target, arrays.particles, arrays.target_width, embedding_);
  batch.type_row = attached(arrays.type_row, arrays.rows, embedding_);
  batch.type_one_hot = one_hot(batch.type_row, embedding_.scalar_type());
  batch.level.push_back(attached_links(arrays, embedding_));
  return batch;
}

at::Tensor GnsPasses::forward(const DeviceBatch& batch, ForwardRecord* record) const {
  const DeviceLevel& links = batch.level.front();
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  State state;
  state.node = fcn_forward(fcn("encoder.node"), input, record ? &record->encoder : nullptr);
  const bool keep_all = record && checkpoint_layers_ == 0;
  state.edge = fcn_forward(fcn("encoder.edge"), links.direction, keep_all ? &record->edge_encoder : nullptr);
  if (record) record->step.resize(static_cast<std::size_t>(config_.message_passing));
  for (int64_t k = 0; k < config_.message_passing; ++k) {
    MessageRecord* const saved = record ? &record->step[static_cast<std::size_t>(k)] : nullptr;
    if (saved && !keep_all && k % checkpoint_layers_ == 0) {
      saved->nodes = state.node;
      saved->edges = state.edge;
    }
    state = step(k, links, state, keep_all ? saved : nullptr);
  }
  return fcn_forward(fcn("decoder"), state.node.narrow(0, 0, batch.particles), record ? &record->decoder : nullptr);
}

/// Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e.
GnsPasses::State GnsPasses::step(int64_t k, const DeviceLevel& links, const State& state, MessageRecord* record) const {
  const int64_t h = config_.latent;
  const Fcn& net = fcn(step_name(k, "edge"));
  const Term sender{at::mm(state.node, net.w1.narrow(1, 0, h).t()), links.sender};
  const Term receiver{at::addmm(net.b1, state.node, net.w1.narrow(1, h, h).t()), links.receiver};
  const at::Tensor hidden = at::mm(state.edge, net.w1.narrow(1, 2 * h, h).t());
  gather_sum_leaky_into(hidden, sender, receiver, {hidden, {}, 0, -1}, net.slope);
  const at::Tensor messages = second_layer(net, hidden, record ? &record->edge : nullptr);
  const at::Tensor received = segment_sum(messages, links.edge_begin, {}, {});
  const at::Tensor change =
      fcn_forward(fcn(step_name(k, "node")), at::cat({received, state.node}, 1), record ? &record->cell : nullptr);
  if (record) {
    record->nodes = state.node;
    record->edges = state.edge;
  }
  return {state.node + change, k + 1 < config_.message_passing ? state.edge + messages : at::Tensor()};
}

void GnsPasses::backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const {
  const DeviceLevel& links = batch.level.front();
  State state;
  state.node = at::zeros({links.cells, config_.latent}, embedding_.options());
  state.node.narrow(0, 0, batch.particles).copy_(fcn_backward(fcn("decoder"), record.decoder, grad));
  state = steps_backward(links, record, state);
  if (checkpoint_layers_ == 0) {
    fcn_backward(fcn("encoder.edge"), record.edge_encoder, state.edge);
  } else {
    FcnRecord again;
    fcn_forward(fcn("encoder.edge"), links.direction, &again);
    fcn_backward(fcn("encoder.edge"), again, state.edge);
  }
  const at::Tensor inputs = fcn_backward(fcn("encoder.node"), record.encoder, state.node);
  at::Tensor embedding_grad = embedding_grad_;
  at::mm_out(embedding_grad, batch.type_one_hot.t(), inputs.narrow(1, batch.features.size(1), config_.embedding));
}

GnsPasses::State GnsPasses::steps_backward(const DeviceLevel& links, const ForwardRecord& record, State grad) const {
  const int64_t steps = config_.message_passing;
  if (checkpoint_layers_ == 0) {
    for (int64_t k = steps; k-- > 0;) grad = step_backward(k, links, record.step[static_cast<std::size_t>(k)], grad);
    return grad;
  }
  for (int64_t first = (steps - 1) / checkpoint_layers_ * checkpoint_layers_; first >= 0; first -= checkpoint_layers_) {
    const int64_t last = std::min(steps, first + checkpoint_layers_);
    std::vector<MessageRecord> again(static_cast<std::size_t>(last - first));
    const MessageRecord& kept = record.step[static_cast<std::size_t>(first)];
    State state{kept.nodes, kept.edges};
    for (int64_t k = first; k < last; ++k) state = step(k, links, state, &again[static_cast<std::size_t>(k - first)]);
    for (int64_t k = last; k-- > first;) {
      grad = step_backward(k, links, again[static_cast<std::size_t>(k - first)], grad);
      again.pop_back();
    }
  }
  return grad;
}

GnsPasses::State GnsPasses::step_backward(int64_t k, const DeviceLevel& links, const MessageRecord& record,
                                          const State& grad) const {
  const int64_t h = config_.latent;
  const Fcn& net = fcn(step_name(k, "edge"));
  const at::Tensor inputs = fcn_backward(fcn(step_name(k, "node")), record.cell, grad.node);
  const at::Tensor messages =
      gather_rows(links.sender.size(0), {inputs.narrow(1, 0, h), links.receiver}, {}, grad.edge);
  const at::Tensor sums = second_layer_backward(net, record.edge, messages);
  const at::Tensor sent = segment_sum(sums, links.edge_begin, links.reverse, {});
  const at::Tensor received = segment_sum(sums, links.edge_begin, {}, {});
  at::Tensor sender_part = net.w1_grad.narrow(1, 0, h), receiver_part = net.w1_grad.narrow(1, h, h);
  at::Tensor edge_part = net.w1_grad.narrow(1, 2 * h, h), b1_grad = net.b1_grad;
  at::mm_out(sender_part, sent.t(), record.nodes);
  at::mm_out(receiver_part, received.t(), record.nodes);
  at::mm_out(edge_part, sums.t(), record.edges);
  at::sum_out(b1_grad, received, 0);
  State before;
  before.node = grad.node + inputs.narrow(1, h, h);
  before.node.addmm_(sent, net.w1.narrow(1, 0, h));
  before.node.addmm_(received, net.w1.narrow(1, h, h));
  const at::Tensor w_edge = net.w1.narrow(1, 2 * h, h);
  before.edge = grad.edge.defined() ? at::addmm(grad.edge, sums, w_edge) : at::mm(sums, w_edge);
  return before;
}

}  // namespace graupel::train
