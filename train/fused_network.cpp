#include "train/fused_network.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/add.h>
#include <ATen/ops/addmm.h>
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
constexpr int64_t second = -1;  ///< stands for W2 among the columns of W1

float* f32(const at::Tensor& tensor) { return static_cast<float*>(tensor.data_ptr()); }
uint16_t* f16(const at::Tensor& tensor) { return static_cast<uint16_t*>(tensor.data_ptr()); }
const int32_t* index(const at::Tensor& tensor) {
  return tensor.defined() ? static_cast<const int32_t*>(tensor.data_ptr()) : nullptr;
}

/// Row r of a [pairs, .] array belongs to particle r / 8 and corner r % 8.
constexpr graph::RowOf by_particle{nullptr, 3, -1};
constexpr graph::RowOf by_corner{nullptr, 0, corners - 1};
constexpr graph::RowOf always_first{nullptr, 0, 0};

/// Bits of 0..7 along the axes, [8, 3].
at::Tensor bits_of_corners(const at::TensorOptions& options) {
  const at::TensorOptions number = options.dtype(at::kInt);
  return at::arange(corners, number)
      .view({-1, 1})
      .__rshift__(at::arange(3, number).view({1, 3}))
      .bitwise_and(1)
      .to(options.dtype());
}

}  // namespace

bool FusedNetwork::fits(const graph::HgnConfig& config, Device device) {
  return device == Device::cuda && config.latent == h && config.input_width() <= h;
}

FusedNetwork::FusedNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                           const at::Tensor& gradient)
    : config_(config),
      fcns_(bind_fcns(layout, flat, gradient)),
      embedding_(view_of(layout.find("embedding.weight"), flat)),
      embedding_grad_(view_of(layout.find("embedding.weight"), gradient)),
      number_(flat.options()),
      half_(flat.options().dtype(at::kBFloat16)) {
  corner_bits_ = bits_of_corners(number_);
  std::vector<float> directions;
  // A sender at -x (slot 0) sees its receiver at +x.
  for (int slot = 0; slot < 6; ++slot)
    for (int d = 0; d < 3; ++d) directions.push_back(slot / 2 != d ? 0.0f : slot % 2 == 0 ? 1.0f : -1.0f);
  slot_vector_ = at::empty({6, 3}, number_.device(at::kCPU));
  std::copy(directions.begin(), directions.end(), f32(slot_vector_));
  slot_vector_ = slot_vector_.to(number_.device());
  octant_offset_ = 0.5 - corner_bits_;
  for (const auto& [name, fcn] : fcns_)
    if (fcn.norm) add_tiles(name, fcn);
  sources_on_device_ = Buffer<graph::TileSource>(Device::cuda, 0);
  sources_on_device_.upload(tile_sources_);
  tiles_ = at::empty({static_cast<int64_t>(tile_sources_.size()), graph::tile_numbers}, half_);
}

void FusedNetwork::add_tiles(const std::string& name, const Fcn& fcn) {
  const auto add = [&](int64_t key, const at::Tensor& matrix, int64_t column) {
    tile_of_[{name, key}] = static_cast<int>(tile_sources_.size());
    tile_sources_.push_back({f32(matrix) + column, static_cast<int32_t>(matrix.stride(0)), h});
  };
  add(second, fcn.w2, 0);
  for (int64_t column = 0; column + h <= fcn.w1.size(1); column += h) add(column, fcn.w1, column);
}

const uint16_t* FusedNetwork::tile(const std::string& fcn, int64_t first_column) const {
  return f16(tiles_) + int64_t{tile_of_.at({fcn, first_column})} * graph::tile_numbers;
}

graph::RowNetwork FusedNetwork::network(const std::string& name, int64_t rows) const {
  const Fcn& net = fcn(name);
  graph::RowNetwork network;
  network.rows = rows;
  network.w2 = tile(name, second);
  network.b2 = f32(net.b2);
  network.gamma = f32(net.gamma);
  network.beta = f32(net.beta);
  return network;
}

at::Tensor FusedNetwork::rows32(int64_t rows) { return kept_.emplace_back(at::empty({rows, h}, number_)); }
at::Tensor FusedNetwork::rows16(int64_t rows) { return kept_.emplace_back(at::empty({rows, h}, half_)); }
FusedNetwork::Latents FusedNetwork::latents(int64_t rows) { return {rows32(rows), rows16(rows)}; }

at::Tensor FusedNetwork::packed(const at::Tensor& numbers) {
  const at::Tensor rows = rows16(numbers.size(0));
  const at::Tensor dense = kept_.emplace_back(numbers.contiguous());
  graph::pack_rows(numbers.size(0), static_cast<int>(numbers.size(1)), f32(dense), f16(rows), nullptr);
  return rows;
}

const uint16_t* FusedNetwork::corner_rows(int64_t particles) {
  if (!corner_rows_.defined() || corner_rows_.size(0) < corners * particles)
    corner_rows_ = packed(corner_bits_.repeat({particles + particles / 4, 1}));  // stays when kept_ is cleared
  return f16(corner_rows_);
}

at::Tensor FusedNetwork::forward(const DeviceBatch& batch) {
  const auto levels = static_cast<std::size_t>(config_.levels);
  GRAUPEL_ASSERT(batch.level.size() == levels);
  kept_.clear();
  graph::pack_tiles(static_cast<int>(tile_sources_.size()), sources_on_device_.data(), f16(tiles_), nullptr);

  const Fcn& encoder = fcn("encoder");
  input_ = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  const at::Tensor first = kept_.emplace_back(at::addmm(encoder.b1, input_, encoder.w1.t()));
  particles_ = latents(batch.particles);
  encoder_ = network("encoder", batch.particles);
  encoder_.table[0] = {f32(first), {}};
  encoder_.sum32 = f32(particles_.f32);
  encoder_.copy16 = f16(particles_.f16);
  graph::forward(encoder_, nullptr);

  down_.assign(levels, {});
  up_.assign(levels, {});
  restriction_.assign(levels, {});
  prolongation_.assign(levels, {});
  std::vector<Latents> f(levels);
  f[0] = particle_to_grid(batch);
  for (std::size_t l = 0; l < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    down_[l].name = "down." + std::to_string(l);
    f[l] = pass_messages(down_[l], level, f[l]);
    if (l + 1 == levels) break;
    const std::string name = "restrict." + std::to_string(l);
    const Fcn& net = fcn(name);
    graph::RowNetwork& restriction = restriction_[l] = network(name, level.cells);
    const at::Tensor table = kept_.emplace_back(at::addmm(net.b1, octant_offset_, net.w1.narrow(1, h, 3).t()));
    const at::Tensor children = rows16(level.cells);
    restriction.operand[0] = {.rows = f16(f[l].f16), .weight = tile(name, 0)};
    restriction.table[0] = {f32(table), {index(level.octant)}};
    restriction.out16 = f16(children);
    graph::forward(restriction, nullptr);
    f[l + 1] = latents(batch.level[l + 1].cells);
    graph::sum_segments({.segments = batch.level[l + 1].cells,
                         .begin = index(level.child_begin),
                         .item = index(level.child),
                         .source = f16(children),
                         .out32 = f32(f[l + 1].f32),
                         .out16 = f16(f[l + 1].f16)},
                        nullptr);
  }
  for (std::size_t l = levels - 1; l-- > 0;) {
    const DeviceLevel& level = batch.level[l];
    const std::string name = "prolong." + std::to_string(l);
    const Fcn& net = fcn(name);
    // The offset points from the coarse centre to the fine one.
    const at::Tensor table =
        kept_.emplace_back(at::addmm(net.b1, octant_offset_, net.w1.narrow(1, 2 * h, 3).t(), 1, -1));
    const Latents refined = latents(level.cells);
    graph::RowNetwork& prolongation = prolongation_[l] = network(name, level.cells);
    prolongation.operand[0] = {.rows = f16(f[l + 1].f16), .index = index(level.parent), .weight = tile(name, 0)};
    prolongation.operand[1] = {.rows = f16(f[l].f16), .weight = tile(name, h)};
    prolongation.table[0] = {f32(table), {index(level.octant)}};
    prolongation.add32 = f32(f[l].f32);
    prolongation.sum32 = f32(refined.f32);
    prolongation.copy16 = f16(refined.f16);
    graph::forward(prolongation, nullptr);
    up_[l].name = "up." + std::to_string(l);
    f[l] = pass_messages(up_[l], level, refined);
  }
  return fcn_forward(fcn("decoder"), grid_to_particle(batch, f[0]), &decoder_);
}

FusedNetwork::Latents FusedNetwork::particle_to_grid(const DeviceBatch& batch) {
  // Layer 1 of pair (i, k), to the grid: W_f f_i + b - W_o offset_i + W_o bits_k; from it: W_c f_cell + W_p f_i + b +
  // W_o offset_i - W_o bits_k. Both networks' parts of a particle are made at once.
  const Fcn &to = fcn("particle_to_grid"), &from = fcn("grid_to_particle");
  const at::Tensor to_offset = kept_.emplace_back(at::addmm(to.b1, batch.offset, to.w1.narrow(1, h, 3).t(), 1, -1));
  const at::Tensor from_offset = kept_.emplace_back(at::addmm(from.b1, batch.offset, from.w1.narrow(1, 2 * h, 3).t()));
  const at::Tensor to_corner = kept_.emplace_back(at::mm(corner_bits_, to.w1.narrow(1, h, 3).t()));
  const at::Tensor from_corner = kept_.emplace_back(at::mm(at::neg(corner_bits_), from.w1.narrow(1, 2 * h, 3).t()));
  const at::Tensor to_particle = rows32(batch.particles), from_particle = rows32(batch.particles);
  graph::project({.rows = batch.particles,
                  .x = f16(particles_.f16),
                  .weight = {tile("particle_to_grid", 0), tile("grid_to_particle", h)},
                  .add = {f32(to_offset), f32(from_offset)},
                  .out = {f32(to_particle), f32(from_particle)}},
                 nullptr);
  const int64_t pairs = corners * batch.particles;
  to_grid_ = network("particle_to_grid", pairs);
  to_grid_.table[0] = {f32(to_particle), by_particle};
  to_grid_.table[1] = {f32(to_corner), by_corner};
  to_particle_ = network("grid_to_particle", pairs);
  to_particle_.table[0] = {f32(from_particle), by_particle};
  to_particle_.table[1] = {f32(from_corner), by_corner};

  const at::Tensor messages = rows16(pairs);
  to_grid_.out16 = f16(messages);
  graph::forward(to_grid_, nullptr);
  const Latents cells = latents(batch.level[0].cells);
  graph::sum_segments({.segments = batch.level[0].cells,
                       .begin = index(batch.pair_begin),
                       .item = index(batch.pair),
                       .source = f16(messages),
                       .weight = f32(batch.weight),
                       .scale = static_cast<float>(config_.p2g_scale),
                       .out32 = f32(cells.f32),
                       .out16 = f16(cells.f16)},
                      nullptr);
  return cells;
}

at::Tensor FusedNetwork::grid_to_particle(const DeviceBatch& batch, const Latents& cells) {
  const at::Tensor per_cell = rows32(batch.level[0].cells);
  graph::project({.rows = batch.level[0].cells,
                  .x = f16(cells.f16),
                  .weight = {tile("grid_to_particle", 0)},
                  .out = {f32(per_cell)}},
                 nullptr);
  to_particle_.table[2] = {f32(per_cell), {index(batch.cell)}};
  const at::Tensor messages = rows16(corners * batch.particles), sums = rows32(batch.particles);
  to_particle_.out16 = f16(messages);
  graph::forward(to_particle_, nullptr);
  graph::sum_segments({.segments = batch.particles,
                       .fixed = corners,
                       .source = f16(messages),
                       .weight = f32(batch.weight),
                       .add32 = f32(particles_.f32),
                       .out32 = f32(sums)},
                      nullptr);
  finest16_ = cells.f16;
  return sums;
}

FusedNetwork::Latents FusedNetwork::pass_messages(Block& block, const DeviceLevel& level, const Latents& start) {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e; e is the unit vector at first, the edge latent after.
  const int64_t edges = level.sender.size(0);
  Latents nodes = start;
  at::Tensor latent;
  for (int64_t k = 0; k < config_.message_passing; ++k) {
    const std::string edge_name = block.name + "." + std::to_string(k) + ".edge";
    const std::string cell_name = block.name + "." + std::to_string(k) + ".cell";
    const Fcn& net = fcn(edge_name);
    Iteration& iteration = block.iterations.emplace_back();
    const at::Tensor sender = rows32(level.cells), receiver = rows32(level.cells);
    graph::project({.rows = level.cells,
                    .x = f16(nodes.f16),
                    .weight = {tile(edge_name, 0), tile(edge_name, h)},
                    .bias = {nullptr, f32(net.b1)},
                    .out = {f32(sender), f32(receiver)}},
                   nullptr);
    const at::Tensor messages = rows16(edges);
    graph::RowNetwork& edge = iteration.edge = network(edge_name, edges);
    edge.table[0] = {f32(sender), {index(level.sender)}};
    edge.table[1] = {f32(receiver), {index(level.receiver)}};
    edge.out16 = f16(messages);
    at::Tensor next_latent = messages;
    if (k == 0) {
      const at::Tensor per_slot = kept_.emplace_back(at::mm(slot_vector_, net.w1.narrow(1, 2 * h, 3).t()));
      edge.table[2] = {f32(per_slot), {index(level.slot)}};
    } else {
      edge.operand[0] = {.rows = f16(latent), .weight = tile(edge_name, 2 * h)};
      if (k + 1 < config_.message_passing) {
        next_latent = rows16(edges);
        edge.add16 = f16(latent);
        edge.sum16 = f16(next_latent);
      }
    }
    graph::forward(edge, nullptr);
    latent = next_latent;

    const Latents next = latents(level.cells);
    graph::RowNetwork& cell = iteration.cell = network(cell_name, level.cells);
    cell.operand[0] = {.rows = f16(messages), .begin = index(level.edge_begin), .weight = tile(cell_name, 0)};
    cell.operand[1] = {.rows = f16(nodes.f16), .weight = tile(cell_name, h)};
    cell.table[0] = {f32(fcn(cell_name).b1), always_first};
    cell.add32 = f32(nodes.f32);
    cell.sum32 = f32(next.f32);
    cell.copy16 = f16(next.f16);
    graph::forward(cell, nullptr);
    nodes = next;
  }
  return nodes;
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
  gradient.hidden = f16(rows16(rows));
  gradient.d_raw = f16(rows16(rows));
  gradient.d_sum = f16(rows16(rows));
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
  const graph::RowNetworkGradient pairs = back_through(
      "grid_to_particle",
      {.network = to_particle_, .g32 = f32(grad_particles), .g_row = by_particle, .g_weight = f32(batch.weight)});
  const at::Tensor per_cell = rows16(batch.level[0].cells);
  graph::sum_segments({.segments = batch.level[0].cells,
                       .begin = index(batch.pair_begin),
                       .item = index(batch.pair),
                       .source = pairs.d_sum,
                       .out16 = f16(per_cell)},
                      nullptr);
  add_product(batch.level[0].cells, f16(per_cell), f16(finest16_), from_grid.w1_grad, 0, h);
  at::Tensor g = rows32(batch.level[0].cells);
  graph::project_back({.rows = batch.level[0].cells,
                       .d = {{.rows = f16(per_cell), .weight = tile("grid_to_particle", 0)}},
                       .sum32 = f32(g)},
                      nullptr);
  pairs_to_particles(batch, "grid_to_particle", pairs, h, 1, grad_particles);

  std::vector<at::Tensor> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    const std::string name = "prolong." + std::to_string(l);
    const Fcn& net = fcn(name);
    g = pass_messages_backward(up_[l], level, g);
    skip[l] = rows32(level.cells);
    const at::Tensor coarse = rows16(level.cells), coarse_input = rows16(level.cells);
    graph::RowNetworkGradient way{.network = prolongation_[l], .g32 = f32(g)};
    way.network.operand[0].save = f16(coarse_input);
    way.operand[0] = {.d16 = f16(coarse)};
    way.operand[1] = {.add32 = f32(g), .d32 = f32(skip[l])};
    way = back_through(name, way);
    add_product(level.cells, way.d_sum, f16(coarse_input), net.w1_grad, 0, h);
    add_product(level.cells, way.d_sum, way.network.operand[1].rows, net.w1_grad, h, h, net.b1_grad);
    add_product(level.cells, way.d_sum, f16(packed(at::neg(level.parent_offset))), net.w1_grad, 2 * h, 3);
    g = rows32(batch.level[l + 1].cells);
    graph::sum_segments({.segments = batch.level[l + 1].cells,
                         .begin = index(level.child_begin),
                         .item = index(level.child),
                         .source = f16(coarse),
                         .out32 = f32(g)},
                        nullptr);
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward(down_[l], batch.level[l], g);
    if (l == 0) break;
    const DeviceLevel& fine = batch.level[l - 1];
    const std::string name = "restrict." + std::to_string(l - 1);
    const Fcn& net = fcn(name);
    const at::Tensor fine_grad = rows32(fine.cells);
    graph::RowNetworkGradient way{.network = restriction_[l - 1], .g32 = f32(g), .g_row = {index(fine.parent)}};
    way.operand[0] = {.add32 = f32(skip[l - 1]), .d32 = f32(fine_grad)};
    way = back_through(name, way);
    add_product(fine.cells, way.d_sum, way.network.operand[0].rows, net.w1_grad, 0, h, net.b1_grad);
    add_product(fine.cells, way.d_sum, f16(packed(fine.parent_offset)), net.w1_grad, h, 3);
    g = fine_grad;
  }

  // Steps 1 and 0: the way to the cells, and the encoder
  const graph::RowNetworkGradient to =
      back_through("particle_to_grid", {.network = to_grid_,
                                        .g32 = f32(g),
                                        .g_row = {index(batch.cell)},
                                        .g_weight = f32(batch.weight),
                                        .g_scale = static_cast<float>(config_.p2g_scale)});
  pairs_to_particles(batch, "particle_to_grid", to, 0, -1, grad_particles);
  const Fcn& encoder = fcn("encoder");
  const graph::RowNetworkGradient rows = back_through("encoder", {.network = encoder_, .g32 = f32(grad_particles)});
  const at::Tensor by_type = kept_.emplace_back(at::empty({h, graph::embedding_rows}, number_));
  add_product(batch.particles, rows.d_sum, f16(packed(input_)), encoder.w1_grad, 0, input_.size(1), encoder.b1_grad);
  add_product(batch.particles, rows.d_sum, f16(packed(batch.type_one_hot)), by_type, 0, graph::embedding_rows);
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
  const at::Tensor per_particle = rows16(batch.particles);
  graph::sum_segments(
      {.segments = batch.particles, .fixed = corners, .source = pairs.d_sum, .out16 = f16(per_particle)}, nullptr);
  add_product(batch.particles, f16(per_particle), f16(particles_.f16), net.w1_grad, particle_column, h, net.b1_grad);
  // Offsets and corners share the last three columns.
  const Sum sum{net.w1_grad.narrow(1, particle_column + h, 3), kept_.emplace_back(at::empty({h, 3}, number_)),
                kept_.emplace_back(at::empty({h, 3}, number_))};
  products_.add({.rows = batch.particles,
                 .d = f16(per_particle),
                 .x = f16(packed(batch.offset)),
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
                       .d = {{.rows = f16(per_particle), .weight = tile(name, particle_column)}},
                       .add32 = f32(grad_particles),
                       .sum32 = f32(grad_particles)},
                      nullptr);
}

at::Tensor FusedNetwork::pass_messages_backward(Block& block, const DeviceLevel& level, at::Tensor grad) {
  const int64_t edges = level.sender.size(0);
  at::Tensor grad_latent;  // of the edge latents after iteration k; none after the last
  for (int64_t k = config_.message_passing; k-- > 0;) {
    const Iteration& iteration = block.iterations[static_cast<std::size_t>(k)];
    const std::string edge_name = block.name + "." + std::to_string(k) + ".edge";
    const std::string cell_name = block.name + "." + std::to_string(k) + ".cell";
    const Fcn &edge_net = fcn(edge_name), &cell_net = fcn(cell_name);

    const at::Tensor received = rows16(level.cells), message_grad = rows32(level.cells),
                     node_grad = rows32(level.cells);
    graph::RowNetworkGradient cell{.network = iteration.cell, .g32 = f32(grad)};
    cell.network.operand[0].save = f16(received);
    cell.operand[0] = {.d32 = f32(message_grad)};
    cell.operand[1] = {.add32 = f32(grad), .d32 = f32(node_grad)};
    cell = back_through(cell_name, cell);
    const uint16_t* const nodes = cell.network.operand[1].rows;
    add_product(level.cells, cell.d_sum, f16(received), cell_net.w1_grad, 0, h);
    add_product(level.cells, cell.d_sum, nodes, cell_net.w1_grad, h, h, cell_net.b1_grad);

    graph::RowNetworkGradient edge{
        .network = iteration.edge, .g32 = f32(message_grad), .g_row = {index(level.receiver)}};
    if (grad_latent.defined()) edge.g16 = f16(grad_latent);
    if (k > 0) {
      const at::Tensor next = rows16(edges);
      edge.operand[0] = {.add16 = edge.g16, .d16 = f16(next)};
      grad_latent = next;
    }
    edge = back_through(edge_name, edge);
    if (k > 0)
      add_product(edges, edge.d_sum, edge.network.operand[0].rows, edge_net.w1_grad, 2 * h, h);
    else
      add_product(edges, edge.d_sum, f16(packed(level.direction)), edge_net.w1_grad, 2 * h, 3);

    const at::Tensor sent = rows16(level.cells), arrived = rows16(level.cells), before = rows32(level.cells);
    graph::project_back({.rows = level.cells,
                         .d = {{.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .item = index(level.reverse),
                                .save = f16(sent),
                                .weight = tile(edge_name, 0)},
                               {.rows = edge.d_sum,
                                .begin = index(level.edge_begin),
                                .save = f16(arrived),
                                .weight = tile(edge_name, h)}},
                         .add32 = f32(node_grad),
                         .sum32 = f32(before)},
                        nullptr);
    add_product(level.cells, f16(sent), nodes, edge_net.w1_grad, 0, h);
    add_product(level.cells, f16(arrived), nodes, edge_net.w1_grad, h, h, edge_net.b1_grad);
    grad = before;
  }
  return grad;
}

}  // namespace graupel::train
