#include "train/fused_network.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/add.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/neg.h>

#include "core/error.h"
#include "graph/features.h"

namespace graupel::train {

namespace {

constexpr int corners = 8;
constexpr int64_t h = graph::layer_width;

float* f32(const at::Tensor& tensor) { return static_cast<float*>(tensor.data_ptr()); }
uint16_t* f16(const at::Tensor& tensor) { return static_cast<uint16_t*>(tensor.data_ptr()); }
const int32_t* index(const at::Tensor& tensor) {
  return tensor.defined() ? static_cast<const int32_t*>(tensor.data_ptr()) : nullptr;
}

/// Row r of a [pairs, .] array belongs to particle r / 8 and corner r % 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};

/// Bits of 0..7 along the axes, [8, 3].
at::Tensor bits_of_corners(const at::TensorOptions& options) {
  const at::TensorOptions number = options.dtype(at::kInt);
  return at::arange(corners, number)
      .view({-1, 1})
      .__rshift__(at::arange(3, number).view({1, 3}))
      .bitwise_and(1)
      .to(options.dtype());
}

/// Weights of the architecture as graph/cuda takes them.
std::map<std::string, graph::FcnWeights> weights_of(const std::map<std::string, Fcn>& fcns) {
  std::map<std::string, graph::FcnWeights> weights;
  for (const auto& [name, fcn] : fcns)
    weights[name] = {f32(fcn.w1),
                     f32(fcn.b1),
                     f32(fcn.w2),
                     f32(fcn.b2),
                     fcn.norm ? f32(fcn.gamma) : nullptr,
                     fcn.norm ? f32(fcn.beta) : nullptr,
                     static_cast<int32_t>(fcn.w1.size(1))};
  return weights;
}

}  // namespace

FusedNetwork::FusedNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                           const at::Tensor& gradient)
    : config_(config),
      fcns_(bind_fcns(layout, flat, gradient)),
      embedding_(view_of(layout.find("embedding.weight"), flat)),
      embedding_grad_(view_of(layout.find("embedding.weight"), gradient)),
      number_(flat.options()),
      half_(flat.options().dtype(at::kBFloat16)),
      packed_(config, weights_of(fcns_), f32(embedding_)) {}

float* FusedNetwork::rows32(int64_t rows) { return f32(kept_.emplace_back(at::empty({rows, h}, number_))); }
uint16_t* FusedNetwork::rows16(int64_t rows) { return f16(kept_.emplace_back(at::empty({rows, h}, half_))); }

const uint16_t* FusedNetwork::packed(const at::Tensor& numbers) {
  uint16_t* const rows = rows16(numbers.size(0));
  const at::Tensor dense = kept_.emplace_back(numbers.contiguous());
  graph::pack_rows(numbers.size(0), static_cast<int>(numbers.size(1)), f32(dense), rows, nullptr);
  return rows;
}

const uint16_t* FusedNetwork::corner_rows(int64_t particles) {
  if (!corner_rows_.defined() || corner_rows_.size(0) < corners * particles) {
    packed(bits_of_corners(number_).repeat({particles + particles / 4, 1}));
    corner_rows_ = kept_[kept_.size() - 2];  // stays when kept_ is cleared
  }
  return f16(corner_rows_);
}

graph::HgnGraph FusedNetwork::graph_of(const DeviceBatch& batch) {
  graph::HgnGraph graph{};
  graph.particles = batch.particles;
  graph.features = f32(kept_.emplace_back(batch.features.contiguous()));
  graph.type_row = index(batch.type_row);
  graph.weight = f32(batch.weight);
  graph.offset = f32(batch.offset);
  graph.cell = index(batch.cell);
  graph.pair_begin = index(batch.pair_begin);
  graph.pair = index(batch.pair);
  for (const DeviceLevel& level : batch.level) {
    graph::LevelLinks links{};
    links.cells = level.cells;
    links.edges = level.sender.size(0);
    links.edge_begin = index(level.edge_begin);
    links.sender = index(level.sender);
    links.receiver = index(level.receiver);
    links.slot = index(level.slot);
    links.reverse = index(level.reverse);
    links.parent = index(level.parent);
    links.octant = index(level.octant);
    links.child_begin = index(level.child_begin);
    links.child = index(level.child);
    graph.level.push_back(links);
  }
  return graph;
}

at::Tensor FusedNetwork::forward(const DeviceBatch& batch) {
  kept_.clear();
  packed_.refresh(nullptr);
  const float* const latents = graph::forward_to_decoder(packed_, graph_of(batch), *this, record_, nullptr);
  const at::Tensor& sums = kept_.back();  // made last
  GRAUPEL_ASSERT(f32(sums) == latents);
  return fcn_forward(fcn("decoder"), sums, &decoder_);
}

void FusedNetwork::add_product(int64_t rows, const uint16_t* d, const uint16_t* x, const at::Tensor& w1_grad,
                               int64_t first_column, int64_t columns, const at::Tensor& bias) {
  products_.add({.rows = rows,
                 .d = d,
                 .x = x,
                 .out = f32(w1_grad) + first_column,
                 .stride = static_cast<int32_t>(w1_grad.stride(0)),
                 .columns = static_cast<int32_t>(columns),
                 .bias = bias.defined() ? f32(bias) : nullptr});
}

graph::RowNetworkGradient FusedNetwork::back_through(const std::string& name, graph::RowNetworkGradient gradient) {
  const Fcn& net = fcn(name);
  const int64_t rows = gradient.network.rows;
  gradient.hidden = rows16(rows);
  gradient.d_raw = rows16(rows);
  gradient.d_sum = rows16(rows);
  gradient.norm_partial = f32(kept_.emplace_back(at::empty({graph::most_norm_partials(), 2 * h}, number_)));
  const int partials = graph::backward(gradient, nullptr);
  add_product(rows, gradient.d_raw, gradient.hidden, net.w2_grad, 0, h, net.b2_grad);
  products_.add(
      {.rows = partials, .partial = gradient.norm_partial, .out = f32(net.gamma_grad), .bias = f32(net.beta_grad)});
  return gradient;
}

void FusedNetwork::backward(const DeviceBatch& batch, const at::Tensor& grad) {
  const auto levels = static_cast<std::size_t>(config_.levels);
  sums_.clear();
  at::Tensor grad_particles = kept_.emplace_back(fcn_backward(fcn("decoder"), decoder_, grad));

  // Step 11: the way from the cells
  const Fcn& from_grid = fcn("grid_to_particle");
  const graph::RowNetworkGradient pairs = back_through("grid_to_particle", {.network = record_.to_particle,
                                                                            .g32 = f32(grad_particles),
                                                                            .g_row = by_particle,
                                                                            .g_weight = f32(batch.weight)});
  uint16_t* const per_cell = rows16(batch.level[0].cells);
  graph::sum_segments({.segments = batch.level[0].cells,
                       .begin = index(batch.pair_begin),
                       .item = index(batch.pair),
                       .are_long = true,
                       .source = pairs.d_sum,
                       .out16 = per_cell},
                      nullptr);
  add_product(batch.level[0].cells, per_cell, record_.finest, from_grid.w1_grad, 0, h);
  float* g = rows32(batch.level[0].cells);
  graph::project_back({.rows = batch.level[0].cells,
                       .d = {{.rows = per_cell, .weight = packed_.tile("grid_to_particle", 0)}},
                       .sum32 = g},
                      nullptr);
  pairs_to_particles(batch, "grid_to_particle", pairs, h, 1, grad_particles);

  std::vector<float*> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    const std::string name = "prolong." + std::to_string(l);
    const Fcn& net = fcn(name);
    g = pass_messages_backward("up." + std::to_string(l), record_.up[l], level, g);
    skip[l] = rows32(level.cells);
    uint16_t *const coarse = rows16(level.cells), *const coarse_input = rows16(level.cells);
    graph::RowNetworkGradient way{.network = record_.prolongation[l], .g32 = g};
    way.network.operand[0].save = coarse_input;
    way.operand[0] = {.d16 = coarse};
    way.operand[1] = {.add32 = g, .d32 = skip[l]};
    way = back_through(name, way);
    add_product(level.cells, way.d_sum, coarse_input, net.w1_grad, 0, h);
    add_product(level.cells, way.d_sum, way.network.operand[1].rows, net.w1_grad, h, h, net.b1_grad);
    add_product(level.cells, way.d_sum, packed(at::neg(level.parent_offset)), net.w1_grad, 2 * h, 3);
    g = rows32(batch.level[l + 1].cells);
    graph::sum_segments({.segments = batch.level[l + 1].cells,
                         .begin = index(level.child_begin),
                         .item = index(level.child),
                         .source = coarse,
                         .out32 = g},
                        nullptr);
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward("down." + std::to_string(l), record_.down[l], batch.level[l], g);
    if (l == 0) break;
    const DeviceLevel& fine = batch.level[l - 1];
    const std::string name = "restrict." + std::to_string(l - 1);
    const Fcn& net = fcn(name);
    float* const fine_grad = rows32(fine.cells);
    graph::RowNetworkGradient way{.network = record_.restriction[l - 1], .g32 = g, .g_row = {index(fine.parent)}};
    way.operand[0] = {.add32 = skip[l - 1], .d32 = fine_grad};
    way = back_through(name, way);
    add_product(fine.cells, way.d_sum, way.network.operand[0].rows, net.w1_grad, 0, h, net.b1_grad);
    add_product(fine.cells, way.d_sum, packed(fine.parent_offset), net.w1_grad, h, 3);
    g = fine_grad;
  }

  // Steps 1 and 0: the way to the cells, and the encoder
  const graph::RowNetworkGradient to =
      back_through("particle_to_grid", {.network = record_.to_grid,
                                        .g32 = g,
                                        .g_row = {index(batch.cell)},
                                        .g_weight = f32(batch.weight),
                                        .g_scale = static_cast<float>(config_.p2g_scale)});
  pairs_to_particles(batch, "particle_to_grid", to, 0, -1, grad_particles);
  const Fcn& encoder = fcn("encoder");
  const graph::RowNetworkGradient rows =
      back_through("encoder", {.network = record_.encoder, .g32 = f32(grad_particles)});
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  const at::Tensor by_type = kept_.emplace_back(at::empty({h, graph::embedding_rows}, number_));
  add_product(batch.particles, rows.d_sum, packed(input), encoder.w1_grad, 0, input.size(1), encoder.b1_grad);
  add_product(batch.particles, rows.d_sum, packed(batch.type_one_hot), by_type, 0, graph::embedding_rows);
  products_.run(nullptr);

  for (const Sum& sum : sums_) {
    at::Tensor to_columns = sum.to;
    at::add_out(to_columns, sum.a, sum.b);
  }
  at::Tensor embedding_grad = embedding_grad_;
  at::mm_out(embedding_grad, by_type.t(), encoder.w1.narrow(1, batch.features.size(1), config_.embedding));
}

void FusedNetwork::pairs_to_particles(const DeviceBatch& batch, const std::string& name,
                                      const graph::RowNetworkGradient& pairs, int64_t particle_column,
                                      float offset_sign, at::Tensor& grad_particles) {
  const Fcn& net = fcn(name);
  uint16_t* const per_particle = rows16(batch.particles);
  graph::sum_segments({.segments = batch.particles, .fixed = corners, .source = pairs.d_sum, .out16 = per_particle},
                      nullptr);
  add_product(batch.particles, per_particle, record_.particles.f16, net.w1_grad, particle_column, h, net.b1_grad);
  // Offsets and corners share the last three columns.
  const Sum sum{net.w1_grad.narrow(1, particle_column + h, 3), kept_.emplace_back(at::empty({h, 3}, number_)),
                kept_.emplace_back(at::empty({h, 3}, number_))};
  products_.add({.rows = batch.particles,
                 .d = per_particle,
                 .x = packed(batch.offset),
                 .out = f32(sum.a),
                 .stride = 3,
                 .columns = 3,
                 .scale = offset_sign});
  products_.add({.rows = pairs.network.rows,
                 .d = pairs.d_sum,
                 .x = corner_rows(batch.particles),
                 .out = f32(sum.b),
                 .stride = 3,
                 .columns = 3,
                 .scale = -offset_sign});
  sums_.push_back(sum);
  graph::project_back({.rows = batch.particles,
                       .d = {{.rows = per_particle, .weight = packed_.tile(name, particle_column)}},
                       .add32 = f32(grad_particles),
                       .sum32 = f32(grad_particles)},
                      nullptr);
}

float* FusedNetwork::pass_messages_backward(const std::string& block, const graph::HgnRecord::Block& record,
                                            const DeviceLevel& level, float* grad) {
  const int64_t edges = level.sender.size(0);
  uint16_t* grad_latent = nullptr;  // of the edge latents after iteration k; none after the last
  for (int64_t k = config_.message_passing; k-- > 0;) {
    const graph::HgnRecord::Iteration& iteration = record[static_cast<std::size_t>(k)];
    const std::string edge_name = block + "." + std::to_string(k) + ".edge";
    const std::string cell_name = block + "." + std::to_string(k) + ".cell";
    const Fcn &edge_net = fcn(edge_name), &cell_net = fcn(cell_name);

    uint16_t* const received = rows16(level.cells);
    float *const message_grad = rows32(level.cells), *const node_grad = rows32(level.cells);
    graph::RowNetworkGradient cell{.network = iteration.cell, .g32 = grad};
    cell.network.operand[0].save = received;
    cell.operand[0] = {.d32 = message_grad};
    cell.operand[1] = {.add32 = grad, .d32 = node_grad};
    cell = back_through(cell_name, cell);
    const uint16_t* const nodes = cell.network.operand[1].rows;
    add_product(level.cells, cell.d_sum, received, cell_net.w1_grad, 0, h);
    add_product(level.cells, cell.d_sum, nodes, cell_net.w1_grad, h, h, cell_net.b1_grad);

    graph::RowNetworkGradient edge{.network = iteration.edge, .g32 = message_grad, .g_row = {index(level.receiver)}};
    edge.g16 = grad_latent;
    if (k > 0) {
      grad_latent = rows16(edges);
      edge.operand[0] = {.add16 = edge.g16, .d16 = grad_latent};
    }
    edge = back_through(edge_name, edge);
    if (k > 0)
      add_product(edges, edge.d_sum, edge.network.operand[0].rows, edge_net.w1_grad, 2 * h, h);
    else
      add_product(edges, edge.d_sum, packed(level.direction), edge_net.w1_grad, 2 * h, 3);

    uint16_t *const sent = rows16(level.cells), *const arrived = rows16(level.cells);
    float* const before = rows32(level.cells);
    graph::project_back({.rows = level.cells,
                         .d = {{.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .item = index(level.reverse),
                                .save = sent,
                                .weight = packed_.tile(edge_name, 0)},
                               {.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .save = arrived,
                                .weight = packed_.tile(edge_name, h)}},
                         .add32 = node_grad,
                         .sum32 = before},
                        nullptr);
    add_product(level.cells, sent, nodes, edge_net.w1_grad, 0, h);
    add_product(level.cells, arrived, nodes, edge_net.w1_grad, h, h, edge_net.b1_grad);
    grad = before;
  }
  return grad;
}

}  // namespace graupel::train
