#include "train/networks/cuda/fused_gns.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/zeros.h>

#include <algorithm>
#include <cstdint>

#include "graph/features/features.h"
#include "graph/topology/gns_graph.h"

namespace graupel::train {

namespace {

constexpr int64_t h = graph::layer_width;

float* f32(const at::Tensor& tensor) { return static_cast<float*>(tensor.data_ptr()); }
uint16_t* f16(const at::Tensor& tensor) { return static_cast<uint16_t*>(tensor.data_ptr()); }
const int32_t* index(const at::Tensor& tensor) {
  return tensor.defined() ? static_cast<const int32_t*>(tensor.data_ptr()) : nullptr;
}

/// At a place from which the kernels read four numbers at once: those of an uploaded batch begin anywhere.
at::Tensor aligned(const at::Tensor& tensor) {
  constexpr std::uintptr_t bytes = 16;
  const bool is_aligned = reinterpret_cast<std::uintptr_t>(tensor.data_ptr()) % bytes == 0;
  return is_aligned && tensor.is_contiguous() ? tensor : tensor.clone();
}

}  // namespace

FusedGns::FusedGns(const graph::GnsConfig& config, int64_t checkpoint_layers, const ParameterLayout& layout,
                   const at::Tensor& flat, const at::Tensor& gradient)
    : config_(config),
      group_(std::clamp<int64_t>(checkpoint_layers, 1, config.message_passing)),
      latent_arrays_((config.message_passing + group_ - 1) / group_ + group_ - 1),
      fcns_(bind_fcns(layout, flat, gradient)),
      embedding_(view_of(layout.find("embedding.weight"), flat)),
      embedding_grad_(view_of(layout.find("embedding.weight"), gradient)),
      number_(flat.options()),
      half_(flat.options().dtype(at::kBFloat16)),
      packed_(layout.plan(), [&](const std::string& name) { return f32(view_of(layout.find(name), flat)); }) {}

float* FusedGns::rows32(int64_t rows) { return f32(kept_.emplace_back(at::empty({rows, h}, number_))); }
uint16_t* FusedGns::rows16(int64_t rows) { return f16(kept_.emplace_back(at::empty({rows, h}, half_))); }

int64_t FusedGns::latent_array(int64_t k) const {
  const int64_t kept = (config_.message_passing + group_ - 1) / group_;
  return k % group_ == 0 ? k / group_ : kept + k % group_ - 1;
}

uint16_t* FusedGns::edge_array(int64_t array) const { return f16(edge_rows_) + array * room_ * h; }

void FusedGns::make_room(int64_t edges) {
  if (edges <= room_) return;
  room_ = edges + edges / 8;
  edge_rows_ = at::Tensor();  // its memory may serve the new one
  edge_rows_ = at::empty({latent_arrays_ + scratch_arrays, room_, h}, half_);
}

FusedGns::Traces FusedGns::edge_traces() const {
  return {edge_array(latent_arrays_ + hidden), edge_array(latent_arrays_ + d_raw), edge_array(latent_arrays_ + d_sum)};
}

at::Tensor FusedGns::forward(const DeviceBatch& batch) {
  const DeviceLevel& links = batch.level.front();
  kept_.clear();
  packed_.refresh(nullptr);
  graph::NetworkGraph graph;
  graph.particles = links.cells;
  graph.features = f32(kept_.emplace_back(batch.features.contiguous()));
  graph.type_row = index(batch.type_row);
  graph.edge_features = f32(kept_.emplace_back(aligned(links.direction)));
  graph.level.push_back({links.as<const int32_t*>(index)});
  make_room(links.edges);
  float* const latents = graph::forward_messages(packed_, graph, *this, this, record_, nullptr);
  return fcn_forward(fcn("decoder"), at::from_blob(latents, {batch.particles, h}, number_), &decoder_);
}

graph::FusedMlpGradient FusedGns::back_through(const std::string& name, graph::FusedMlpGradient gradient,
                                               const Traces& traces) {
  const Fcn& net = fcn(name);
  gradient.hidden = traces.hidden;
  gradient.d_raw = traces.d_raw;
  gradient.d_sum = traces.d_sum;
  gradient.norm_partial = f32(kept_.emplace_back(at::empty({graph::most_norm_partials(), 2, h}, number_)));
  const int partials = graph::backward(gradient, nullptr);
  add_product(gradient.network.rows, traces.d_raw, traces.hidden, net.w2_grad, 0, h, net.b2_grad);
  products_.add({.rows = partials,
                 .partial = gradient.norm_partial,
                 .parts = 2,
                 .out = f32(net.gamma_grad),
                 .bias = f32(net.beta_grad)});
  return gradient;
}

void FusedGns::add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad,
                           int64_t first_column, int64_t columns, const at::Tensor& bias) {
  products_.add({.rows = rows,
                 .d = d,
                 .x = x,
                 .out = f32(w1_grad) + first_column,
                 .stride = static_cast<int32_t>(w1_grad.stride(0)),
                 .columns = static_cast<int32_t>(columns),
                 .bias = bias.defined() ? f32(bias) : nullptr});
}

const uint16_t* FusedGns::packed(const at::Tensor& numbers) {
  uint16_t* const rows = rows16(numbers.size(0));
  const at::Tensor dense = kept_.emplace_back(numbers.contiguous());
  graph::pack_rows(numbers.size(0), static_cast<int>(numbers.size(1)), f32(dense), rows, nullptr);
  return rows;
}

void FusedGns::backward(const DeviceBatch& batch, const at::Tensor& grad) {
  const DeviceLevel& links = batch.level.front();
  const at::Tensor all = kept_.emplace_back(at::zeros({links.cells, h}, number_));
  all.narrow(0, 0, batch.particles).copy_(fcn_backward(fcn("decoder"), decoder_, grad));
  node_grad_ = f32(all);
  node_traces_ = {rows16(links.cells), rows16(links.cells), rows16(links.cells)};
  const int64_t steps = config_.message_passing;
  for (int64_t first = (steps - 1) / group_ * group_; first >= 0; first -= group_) {
    const int64_t last = std::min(steps, first + group_);
    if (last < steps) latents_again(first, last);  // those of the last group are still there
    for (int64_t k = last; k-- > first;) step_backward(k, links);
  }
  edge_encoder_backward(links);
  node_encoder_backward(batch);
}

void FusedGns::latents_again(int64_t first, int64_t last) {
  for (int64_t k = first; k + 1 < last; ++k) {
    graph::FusedMlp again = record_.step[static_cast<std::size_t>(k)].edge;
    again.out16 = nullptr;
    graph::forward(again, nullptr);
  }
}

void FusedGns::step_backward(int64_t k, const DeviceLevel& links) {
  const graph::MessageRecord::Step& record = record_.step[static_cast<std::size_t>(k)];
  const std::string edge_name = "step." + std::to_string(k) + ".edge",
                    node_name = "step." + std::to_string(k) + ".node";
  const Fcn &edge_net = fcn(edge_name), &node_net = fcn(node_name);
  const int64_t nodes = links.cells, edges = record.edge.rows;
  const uint16_t* const f = record.node.operand[1].rows;

  const at::Tensor by_message = at::empty({nodes, h}, number_), by_node = at::empty({nodes, h}, number_);
  graph::FusedMlpGradient node{.network = record.node, .g32 = node_grad_};
  node.operand[0] = {.d32 = f32(by_message)};
  node.operand[1] = {.add32 = node_grad_, .d32 = f32(by_node)};
  back_through(node_name, node, node_traces_);
  add_product(nodes, node_traces_.d_sum, record.node.operand[0].rows, node_net.w1_grad, 0, h);
  add_product(nodes, node_traces_.d_sum, f, node_net.w1_grad, h, h, node_net.b1_grad);

  const Traces traces = edge_traces();
  uint16_t* const edge_grad = edge_array(latent_arrays_ + latent_grad);
  graph::FusedMlpGradient edge{.network = record.edge, .g32 = f32(by_message), .g_row = {index(links.receiver)}};
  edge.g16 = k + 1 < config_.message_passing ? edge_grad : nullptr;
  edge.operand[0] = {.add16 = edge.g16, .d16 = edge_grad};  // each number is read before it is written
  back_through(edge_name, edge, traces);
  add_product(edges, traces.d_sum, record.edge.operand[0].rows, edge_net.w1_grad, 2 * h, h);

  const at::Tensor sent = at::empty({nodes, h}, half_), arrived = at::empty({nodes, h}, half_);
  graph::SegmentRows sums{
      .segments = nodes, .begin = index(links.edge_begin), .are_long = true, .source = traces.d_sum};
  sums.out16 = f16(arrived);
  graph::sum_segments(sums, nullptr);
  sums.item = index(links.reverse);
  sums.out16 = f16(sent);
  graph::sum_segments(sums, nullptr);
  graph::project_back({.rows = nodes,
                       .d = {{.rows = f16(sent), .weight = packed_.tile(edge_name, 0)},
                             {.rows = f16(arrived), .weight = packed_.tile(edge_name, h)}},
                       .add32 = f32(by_node),
                       .sum32 = node_grad_},
                      nullptr);
  add_product(nodes, f16(sent), f, edge_net.w1_grad, 0, h);
  add_product(nodes, f16(arrived), f, edge_net.w1_grad, h, h, edge_net.b1_grad);
  products_.run(nullptr);
}

void FusedGns::edge_encoder_backward(const DeviceLevel& links) {
  const Fcn& net = fcn("encoder.edge");
  const int64_t edges = record_.edge_encoder.rows;
  const Traces traces = edge_traces();
  back_through("encoder.edge", {.network = record_.edge_encoder, .g16 = edge_array(latent_arrays_ + latent_grad)},
               traces);
  uint16_t* const features = latent(0);  // of no further use
  graph::pack_rows(edges, graph::edge_feature_count, f32(links.direction), features, nullptr);
  add_product(edges, traces.d_sum, features, net.w1_grad, 0, graph::edge_feature_count, net.b1_grad);
  products_.run(nullptr);
}

void FusedGns::node_encoder_backward(const DeviceBatch& batch) {
  const Fcn& net = fcn("encoder.node");
  const int64_t nodes = record_.node_encoder.rows;
  back_through("encoder.node", {.network = record_.node_encoder, .g32 = node_grad_}, node_traces_);
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  const at::Tensor by_type = at::empty({h, graph::embedding_rows}, number_);
  add_product(nodes, node_traces_.d_sum, packed(input), net.w1_grad, 0, input.size(1), net.b1_grad);
  add_product(nodes, node_traces_.d_sum, packed(batch.type_one_hot), by_type, 0, graph::embedding_rows);
  products_.run(nullptr);
  at::Tensor embedding_grad = embedding_grad_;
  at::mm_out(embedding_grad, by_type.t(), net.w1.narrow(1, batch.features.size(1), config_.embedding));
}

}  // namespace graupel::train
