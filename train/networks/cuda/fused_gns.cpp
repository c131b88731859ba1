#include "train/networks/cuda/fused_gns.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/zeros.h>

#include <algorithm>

#include "graph/features/features.h"
#include "graph/plan/plan_walk.h"
#include "graph/topology/gns_graph.h"

namespace graupel::train {

FusedGns::FusedGns(const ParameterLayout& layout, int64_t checkpoint_layers, const at::Tensor& flat,
                   const at::Tensor& gradient)
    : FusedNetwork(layout, flat, gradient),
      steps_(plan().blocks.front().iterations),
      group_(std::clamp<int64_t>(checkpoint_layers, 1, steps_)),
      latent_arrays_((steps_ + group_ - 1) / group_ + group_ - 1) {}

int64_t FusedGns::latent_array(int64_t k) const {
  const int64_t kept = (steps_ + group_ - 1) / group_;
  return k % group_ == 0 ? k / group_ : kept + k % group_ - 1;
}

void FusedGns::ensure_capacity(int64_t edges) {
  if (edges <= capacity_) return;
  capacity_ = edges + edges / 8;
  edge_rows_ = at::Tensor();  // its memory may serve the new one
  edge_rows_ = at::empty({latent_arrays_ + scratch_arrays, capacity_, h}, half_);
}

at::Tensor FusedGns::forward(const DeviceBatch& batch) {
  const graph::NetworkGraph graph = begin(batch);
  ensure_capacity(batch.level.front().edges);
  return decode(graph::forward_messages(packed_, graph, *this, this, record_, nullptr), batch.particles);
}

void FusedGns::backward(const DeviceBatch& batch, const at::Tensor& grad) {
  const DeviceLevel& links = batch.level.front();
  const at::Tensor all = kept_.emplace_back(at::zeros({links.cells, h}, number_));
  all.narrow(0, 0, batch.particles).copy_(decoder_backward(grad));
  node_grad_ = f32(all);
  node_traces_ = new_traces(links.cells);
  for (int64_t first = (steps_ - 1) / group_ * group_; first >= 0; first -= group_) {
    const int64_t last = std::min(steps_, first + group_);
    if (last < steps_) latents_again(first, last);  // those of the last group are still there
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
  const graph::BlockLayers layers = graph::layers_of(plan(), plan().blocks.front(), k);
  const std::string edge_first = layers.gather->name + ".layer1", node_first = layers.update->name + ".layer1";
  const int64_t nodes = links.cells, edges = record.edge.rows;
  const uint16_t* const f = record.node.operand[1].rows;

  const at::Tensor by_message = at::empty({nodes, h}, number_), by_node = at::empty({nodes, h}, number_);
  graph::FusedMlpGradient node{.network = record.node, .g32 = node_grad_};
  node.operand[0] = {.d32 = f32(by_message)};
  node.operand[1] = {.add32 = node_grad_, .d32 = f32(by_node)};
  back_through(layers.update->name, node, node_traces_);
  add_product(nodes, node_traces_.d_sum, record.node.operand[0].rows, node_first, 0, h);
  add_product(nodes, node_traces_.d_sum, f, node_first, h, h, true);

  const Traces traces = edge_traces();
  uint16_t* const edge_grad = edge_array(latent_arrays_ + latent_grad);
  graph::FusedMlpGradient edge{.network = record.edge, .g32 = f32(by_message), .g_row = {index(links.receiver)}};
  edge.g16 = k + 1 < steps_ ? edge_grad : nullptr;
  edge.operand[0] = {.add16 = edge.g16, .d16 = edge_grad};  // each number is read before it is written
  back_through(layers.gather->name, edge, traces);
  add_product(edges, traces.d_sum, record.edge.operand[0].rows, edge_first, 2 * h, h);

  const at::Tensor sent = at::empty({nodes, h}, half_), arrived = at::empty({nodes, h}, half_);
  graph::SegmentRows sums{
      .segments = nodes, .begin = index(links.edge_begin), .are_long = true, .source = traces.d_sum};
  sums.out16 = f16(arrived);
  graph::sum_segments(sums, nullptr);
  sums.item = index(links.reverse);
  sums.out16 = f16(sent);
  graph::sum_segments(sums, nullptr);
  graph::project_back({.rows = nodes,
                       .d = {{.rows = f16(sent), .weight = packed_.tile(layers.gather->name, 0)},
                             {.rows = f16(arrived), .weight = packed_.tile(layers.gather->name, h)}},
                       .add32 = f32(by_node),
                       .sum32 = node_grad_},
                      nullptr);
  add_product(nodes, f16(sent), f, edge_first, 0, h);
  add_product(nodes, f16(arrived), f, edge_first, h, h, true);
  products_.run(nullptr);
}

void FusedGns::edge_encoder_backward(const DeviceLevel& links) {
  const std::string& name = plan().layers[1].name;
  const int64_t edges = record_.edge_encoder.rows;
  const Traces traces = edge_traces();
  back_through(name, {.network = record_.edge_encoder, .g16 = edge_array(latent_arrays_ + latent_grad)}, traces);
  uint16_t* const features = latent(0);  // of no further use
  graph::pack_rows(edges, graph::edge_feature_count, f32(links.direction), features, nullptr);
  add_product(edges, traces.d_sum, features, name + ".layer1", 0, graph::edge_feature_count, true);
  products_.run(nullptr);
}

void FusedGns::node_encoder_backward(const DeviceBatch& batch) {
  const std::string& name = plan().layers.front().name;
  const int64_t nodes = record_.node_encoder.rows;
  back_through(name, {.network = record_.node_encoder, .g32 = node_grad_}, node_traces_);
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, weight("embedding.weight"))}, 1);
  const at::Tensor by_type = at::empty({h, graph::embedding_rows}, number_);
  add_product(nodes, node_traces_.d_sum, packed(input), name + ".layer1", 0, input.size(1), true);
  products_.add({.rows = nodes,
                 .d = node_traces_.d_sum,
                 .x = packed(batch.type_one_hot),
                 .out = f32(by_type),
                 .stride = static_cast<int32_t>(graph::embedding_rows),
                 .columns = static_cast<int32_t>(graph::embedding_rows)});
  products_.run(nullptr);
  at::Tensor embedding_grad = gradient("embedding.weight");
  at::mm_out(embedding_grad, by_type.t(),
             weight(name + ".layer1.weight").narrow(1, batch.features.size(1), plan().embedding));
}

}  // namespace graupel::train
