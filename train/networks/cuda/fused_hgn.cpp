#include "train/networks/cuda/fused_hgn.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/mm.h>

#include "graph/features/features.h"

namespace graupel::train {

FusedHgn::FusedHgn(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                   const at::Tensor& gradient)
    : config_(config),
      fcns_(bind_fcns(layout, flat, gradient)),
      gathers_(bind_gathers(layout, flat, gradient)),
      number_(flat.options()),
      half_(flat.options().dtype(at::kBFloat16)),
      embedding_(view_of(layout.find("embedding.weight"), flat)),
      embedding_grad_(view_of(layout.find("embedding.weight"), gradient)),
      packed_(layout.plan(), [&](const std::string& name) { return f32(view_of(layout.find(name), flat)); }) {}

at::Tensor FusedHgn::forward(const DeviceBatch& batch) {
  kept_.clear();
  packed_.refresh(nullptr);
  const graph::RowLatents latents = to_decoder(graph_of(batch));
  if (config_.bundle > 1)
    return fcn_forward(fcn("decoder"), at::from_blob(latents.f32, {batch.particles, h}, number_), &decoder_);
  before_decoder_ = latents.f16;
  const Fcn& net = fcn("decoder");
  const at::Tensor out = at::empty({batch.particles, 3}, number_);
  graph::decode({.rows = batch.particles,
                 .x16 = latents.f16,
                 .w1 = packed_.tile("decoder", 0),
                 .b1 = f32(net.b1),
                 .w2 = f32(net.w2),
                 .b2 = f32(net.b2),
                 .out = f32(out)},
                nullptr);
  return out;
}

float* FusedHgn::decoder_backward(int64_t particles, const at::Tensor& grad) {
  const Fcn& net = fcn("decoder");
  if (config_.bundle > 1) return f32(kept_.emplace_back(fcn_backward(net, decoder_, grad).contiguous()));
  graph::DecoderGradient back{.rows = particles,
                              .x16 = before_decoder_,
                              .w1 = packed_.tile("decoder", 0),
                              .b1 = f32(net.b1),
                              .w2 = f32(net.w2),
                              .g = f32(kept_.emplace_back(grad.contiguous())),
                              .d_sum = rows16(particles),
                              .d_x = rows32(particles),
                              .partial = partials(graph::most_norm_partials(), 4)};
  const int rows = graph::decode_backward(back, nullptr);
  products_.add({.rows = rows,
                 .partial = back.partial,
                 .parts = 4,
                 .out = f32(net.w2_grad),
                 .step = h,
                 .bias = f32(net.b2_grad),
                 .biases = 3});
  add_product(particles, back.d_sum, before_decoder_, net.w1_grad, 0, h, net.b1_grad);
  return back.d_x;
}

float* FusedHgn::partials(int64_t rows, int64_t parts) {
  return f32(kept_.emplace_back(at::empty({rows, parts, h}, number_)));
}

void FusedHgn::backward(const DeviceBatch& batch, const at::Tensor& grad) {
  const float* const grad_particles = back_to_encoder(batch, decoder_backward(batch.particles, grad));
  // The inputs that belong to the embedding are a row of it a type: first the sums over the particles of a type.
  const Fcn& net = fcn("encoder");
  const graph::FusedMlpGradient rows = back_through("encoder", {.network = encoder(), .g32 = grad_particles});
  const int64_t features = batch.features.size(1);
  const at::Tensor inputs = at::cat({batch.features, batch.type_one_hot}, 1);
  const at::Tensor sums = kept_.emplace_back(at::empty({h, inputs.size(1)}, number_));
  add_product(batch.particles, rows.d_sum, packed(inputs), sums, 0, inputs.size(1), net.b1_grad);
  products_.run(nullptr);
  const at::Tensor by_type = sums.narrow(1, features, graph::embedding_rows);
  at::Tensor embedding_columns = net.w1_grad.narrow(1, features, config_.embedding), embedding_grad = embedding_grad_;
  net.w1_grad.narrow(1, 0, features).copy_(sums.narrow(1, 0, features));
  at::mm_out(embedding_columns, by_type, embedding_);
  at::mm_out(embedding_grad, by_type.t(), net.w1.narrow(1, features, config_.embedding));
}

float* FusedHgn::rows32(int64_t rows) { return f32(kept_.emplace_back(at::empty({rows, h}, number_))); }
uint16_t* FusedHgn::rows16(int64_t rows) { return f16(kept_.emplace_back(at::empty({rows, h}, half_))); }

const uint16_t* FusedHgn::packed(const at::Tensor& numbers) {
  uint16_t* const rows = rows16(numbers.size(0));
  const at::Tensor dense = kept_.emplace_back(numbers.contiguous());
  graph::pack_rows(numbers.size(0), static_cast<int>(numbers.size(1)), f32(dense), rows, nullptr);
  return rows;
}

graph::NetworkGraph FusedHgn::graph_of(const DeviceBatch& batch) {
  graph::NetworkGraph graph;
  graph.particles = batch.particles;
  graph.features = f32(kept_.emplace_back(batch.features.contiguous()));
  graph.type_row = index(batch.type_row);
  graph.weight = f32(batch.weight);
  graph.offset = f32(batch.offset);
  graph.cell = index(batch.cell);
  graph.pair_begin = index(batch.pair_begin);
  graph.pair = index(batch.pair);
  for (const DeviceLevel& level : batch.level) graph.level.push_back({level.as<const int32_t*>(index)});
  return graph;
}

void FusedHgn::add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad,
                           int64_t first_column, int64_t columns, const at::Tensor& bias) {
  products_.add({.rows = rows,
                 .d = d,
                 .x = x,
                 .out = f32(w1_grad) + first_column,
                 .stride = static_cast<int32_t>(w1_grad.stride(0)),
                 .columns = static_cast<int32_t>(columns),
                 .bias = bias.defined() ? f32(bias) : nullptr});
}

graph::FusedMlpGradient FusedHgn::back_through(const std::string& name, graph::FusedMlpGradient gradient) {
  const Fcn& net = fcn(name);
  const int64_t rows = gradient.network.rows;
  gradient.hidden = rows16(rows);
  gradient.d_raw = rows16(rows);
  gradient.d_sum = rows16(rows);
  gradient.norm_partial = partials(graph::most_norm_partials(), 2);
  const int partial_rows = graph::backward(gradient, nullptr);
  add_product(rows, gradient.d_raw, gradient.hidden, net.w2_grad, 0, h, net.b2_grad);
  products_.add({.rows = partial_rows,
                 .partial = gradient.norm_partial,
                 .parts = 2,
                 .out = f32(net.gamma_grad),
                 .bias = f32(net.beta_grad)});
  return gradient;
}

void FusedHgn::octants_backward(const DeviceLevel& level, const uint16_t* d, float sign, const at::Tensor& w_grad) {
  offsets_backward(w_grad, graph::ActivationGradient{.nodes = level.cells,
                                                     .items = {.fixed = 1},
                                                     .g = d,
                                                     .is_receiver = true,
                                                     .scale = sign,
                                                     .offsets = graph::Offsets::octant,
                                                     .octant = index(level.octant)});
}

float* FusedHgn::prolong_backward(std::size_t l, const graph::FusedMlp& network, const DeviceBatch& batch, float* g,
                                  float* skip) {
  const DeviceLevel& level = batch.level[l];
  const std::string name = "prolong." + std::to_string(l);
  const Fcn& net = fcn(name);
  uint16_t *const coarse = rows16(level.cells), *const coarse_input = rows16(level.cells);
  graph::FusedMlpGradient way{.network = network, .g32 = g};
  way.network.operand[0].save = coarse_input;
  way.operand[0] = {.d16 = coarse};
  way.operand[1] = {.add32 = g, .d32 = skip};
  way = back_through(name, way);
  add_product(level.cells, way.d_sum, coarse_input, net.w1_grad, 0, h);
  add_product(level.cells, way.d_sum, way.network.operand[1].rows, net.w1_grad, h, h, net.b1_grad);
  octants_backward(level, way.d_sum, -1, net.w1_grad);
  float* const above = rows32(batch.level[l + 1].cells);
  graph::sum_segments({.segments = batch.level[l + 1].cells,
                       .begin = index(level.child_begin),
                       .item = index(level.child),
                       .source = coarse,
                       .out32 = above},
                      nullptr);
  return above;
}

}  // namespace graupel::train
