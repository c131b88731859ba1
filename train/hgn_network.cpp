#include "train/hgn_network.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/add.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/index_select.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/neg.h>
#include <ATen/ops/sum.h>

#include "core/error.h"
#include "graph/features.h"

namespace graupel::train {

namespace {

constexpr int corners = 8;

/// Row r of a [pairs, .] tensor belongs to particle r / 8 and corner r % 8.
Term by_particle(const at::Tensor& table) { return {table, {}, 3, -1}; }
Term by_corner(const at::Tensor& table) { return {table, {}, 0, corners - 1}; }
Term row_by_row(const at::Tensor& table) { return {table, {}, 0, -1}; }

/// Sums of a [particles * 8, H] tensor over the particles, [8, H].
at::Tensor sum_by_corner(const at::Tensor& pairs) {
  const int64_t width = pairs.size(1);
  return at::sum(pairs.view({-1, corners * width}), 0).view({corners, width});
}

}  // namespace

DeviceBatch HgnNetwork::upload(const Batch& batch) const {
  const UploadedBatch uploaded(batch, embedding_);
  const auto index = [&](const Part& part) { return uploaded.index(part); };
  DeviceBatch on_device = uploaded.particles(batch);
  on_device.weight = uploaded.numbers(batch.weight);
  on_device.offset = uploaded.rows(batch.offset, 3);
  on_device.cell = index(batch.cell);
  on_device.pair_begin = index(batch.pair_begin);
  on_device.pair = index(batch.pair);
  for (const BatchLevel& level : batch.level) {
    DeviceLevel links;
    links.cells = level.cells;
    links.edge_begin = index(level.edge_begin);
    links.sender = index(level.sender);
    links.receiver = index(level.receiver);
    links.slot = index(level.slot);
    links.reverse = index(level.reverse);
    if (level.parent.count > 0) {
      links.parent = index(level.parent);
      links.child_begin = index(level.child_begin);
      links.child = index(level.child);
    }
    add_offsets(links, index(level.octant));
    on_device.level.push_back(std::move(links));
  }
  return on_device;
}

DeviceBatch HgnNetwork::attach(const SampleArrays& arrays) const {
  const at::TensorOptions number = embedding_.options();
  const auto wrap = [&](const auto* data, int64_t begin, int64_t count, at::ScalarType type) {
    // from_blob takes no const data; the tensor is only read.
    return at::from_blob(const_cast<std::decay_t<decltype(*data)>*>(data) + begin, {count}, number.dtype(type));
  };
  const auto values = [&](const float* data, int64_t width) {
    const at::Tensor all = wrap(data, 0, arrays.particles * width, at::kFloat).to(number.dtype());
    return width == 1 ? all : all.view({-1, width});
  };
  const auto index = [&](const int32_t* data, int64_t begin, int64_t count) {
    return wrap(data, begin, count, at::kInt);
  };
  const graph::GridLinks& links = arrays.links;
  DeviceBatch batch;
  batch.particles = arrays.particles;
  batch.features = values(arrays.features, arrays.feature_width);
  batch.weight = values(links.weight, corners).view({-1});
  batch.offset = values(links.offset, 3);
  batch.target = values(arrays.target, 3);
  batch.type_row = index(arrays.type_row, 0, arrays.particles);
  batch.type_one_hot = one_hot(batch.type_row, embedding_.scalar_type());
  batch.cell = index(links.cell, 0, corners * arrays.particles);
  batch.pair_begin = index(links.pair_begin, 0, arrays.counts.cells[0] + 1);
  batch.pair = index(links.pair, 0, corners * arrays.particles);
  int64_t first_cell = 0, first_edge = 0;
  for (int l = 0; l < arrays.counts.levels; ++l) {
    const int64_t cells = arrays.counts.cells[static_cast<std::size_t>(l)],
                  edges = arrays.counts.edges[static_cast<std::size_t>(l)];
    DeviceLevel level;
    level.cells = cells;
    level.edge_begin = index(links.edge_begin, first_cell, cells + 1) - first_edge;
    level.sender = index(links.sender, first_edge, edges);
    level.receiver = index(links.receiver, first_edge, edges);
    level.slot = index(links.slot, first_edge, edges);
    level.reverse = index(links.reverse, first_edge, edges);
    if (l + 1 < arrays.counts.levels) {
      // All cells of a level are children of the next one, and level 0 has none: children are counted as cells are.
      const int64_t parents = arrays.counts.cells[static_cast<std::size_t>(l) + 1];
      level.parent = index(links.parent, first_cell, cells);
      level.child_begin = index(links.child_begin, first_cell + cells, parents + 1) - first_cell;
      level.child = index(links.child, first_cell, cells);
    }
    add_offsets(level, index(links.octant, first_cell, cells));
    batch.level.push_back(std::move(level));
    first_cell += cells;
    first_edge += edges;
  }
  return batch;
}

void HgnNetwork::add_offsets(DeviceLevel& level, const at::Tensor& octant) const {
  level.direction = at::index_select(slot_vector_, 0, level.slot);
  level.octant = octant;
  if (!level.parent.defined()) return;
  // A child at corner b of its parent lies at (b - 1/2) spacings from the parent's centre.
  const at::Tensor axis = at::arange(3, octant.options()).view({1, 3});
  level.parent_offset = 0.5 - octant.view({-1, 1}).__rshift__(axis).bitwise_and(1).to(embedding_.dtype());
}

HgnNetwork::HgnNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                       const at::Tensor& gradient)
    : config_(config), fcns_(bind_fcns(layout, flat, gradient)) {
  const Parameter& embedding = layout.find("embedding.weight");
  embedding_ = view_of(embedding, flat);
  if (gradient.defined()) embedding_grad_ = view_of(embedding, gradient);
  std::vector<float> bits, directions;
  for (int k = 0; k < corners; ++k)
    for (int d = 0; d < 3; ++d) bits.push_back(static_cast<float>((k >> d) & 1));
  // A sender at -x (slot 0) sees its receiver at +x.
  for (int slot = 0; slot < 6; ++slot)
    for (int d = 0; d < 3; ++d) directions.push_back(slot / 2 != d ? 0.0f : slot % 2 == 0 ? 1.0f : -1.0f);
  corner_bits_ = to_device(bits, flat.device()).to(flat.dtype()).view({corners, 3});
  slot_vector_ = to_device(directions, flat.device()).to(flat.dtype()).view({6, 3});
}

at::Tensor HgnNetwork::forward(const DeviceBatch& batch, ForwardRecord* record) const {
  const auto levels = static_cast<std::size_t>(config_.levels);
  GRAUPEL_ASSERT(batch.level.size() == levels);
  if (record) {
    record->down.resize(levels);
    record->up.resize(levels);
    record->restriction.resize(levels);
    record->prolongation.resize(levels);
  }
  const at::Tensor input = at::cat({batch.features, at::mm(batch.type_one_hot, embedding_)}, 1);
  const at::Tensor particles = fcn_forward(fcn("encoder"), input, record ? &record->encoder : nullptr);

  std::vector<at::Tensor> f(levels);
  f[0] = particle_to_grid(batch, particles, record ? &record->to_grid : nullptr);
  for (std::size_t l = 0; l < levels; ++l) {
    const DeviceLevel& level = batch.level[l];
    f[l] = pass_messages("down." + std::to_string(l), level, f[l], record ? &record->down[l] : nullptr);
    if (l + 1 == levels) break;
    const at::Tensor children =
        fcn_forward(fcn("restrict." + std::to_string(l)), at::cat({f[l], level.parent_offset}, 1),
                    record ? &record->restriction[l] : nullptr);
    f[l + 1] = segment_sum(children, level.child_begin, level.child, {});
  }
  for (std::size_t l = levels - 1; l-- > 0;) {
    const DeviceLevel& level = batch.level[l];
    const at::Tensor coarse = gather_rows(level.cells, {f[l + 1], level.parent}, {}, {});
    f[l + 1].reset();
    // The offset points from the coarse centre to the fine one.
    const at::Tensor refined =
        fcn_forward(fcn("prolong." + std::to_string(l)), at::cat({coarse, f[l], at::neg(level.parent_offset)}, 1),
                    record ? &record->prolongation[l] : nullptr);
    f[l] = pass_messages("up." + std::to_string(l), level, f[l] + refined, record ? &record->up[l] : nullptr);
  }
  const at::Tensor change = grid_to_particle(batch, f[0], particles, record ? &record->to_particle : nullptr);
  return fcn_forward(fcn("decoder"), particles + change, record ? &record->decoder : nullptr);
}

void HgnNetwork::backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const {
  const auto levels = static_cast<std::size_t>(config_.levels);
  const int64_t h = config_.latent;
  at::Tensor grad_particles = fcn_backward(fcn("decoder"), record.decoder, grad);
  at::Tensor g = grid_to_particle_backward(batch, record.to_particle, grad_particles, grad_particles);

  std::vector<at::Tensor> skip(levels);  // gradient of level l's cells through the up pass
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    g = pass_messages_backward("up." + std::to_string(l), batch.level[l], record.up[l], g);
    const at::Tensor inputs = fcn_backward(fcn("prolong." + std::to_string(l)), record.prolongation[l], g);
    skip[l] = g + inputs.narrow(1, h, h);
    g = segment_sum(inputs.narrow(1, 0, h), batch.level[l].child_begin, batch.level[l].child, {});
  }
  for (std::size_t l = levels; l-- > 0;) {
    g = pass_messages_backward("down." + std::to_string(l), batch.level[l], record.down[l], g);
    if (l == 0) break;
    const DeviceLevel& fine = batch.level[l - 1];
    const at::Tensor children = gather_rows(fine.cells, {g, fine.parent}, {}, {});
    const at::Tensor inputs =
        fcn_backward(fcn("restrict." + std::to_string(l - 1)), record.restriction[l - 1], children);
    g = skip[l - 1] + inputs.narrow(1, 0, h);
  }
  particle_to_grid_backward(batch, record.to_grid, g, grad_particles);
  const at::Tensor inputs = fcn_backward(fcn("encoder"), record.encoder, grad_particles);
  at::Tensor embedding_grad = embedding_grad_;
  at::mm_out(embedding_grad, batch.type_one_hot.t(), inputs.narrow(1, batch.features.size(1), config_.embedding));
}

at::Tensor HgnNetwork::particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles,
                                        PairRecord* record) const {
  // Layer 1 of pair (i, k): W_f f_i + b - W_o offset_i + W_o bits_k.
  const Fcn& net = fcn("particle_to_grid");
  const at::Tensor input = at::cat({particles, at::neg(batch.offset)}, 1);
  const at::Tensor per_particle = at::addmm(net.b1, input, net.w1.t());
  const at::Tensor per_corner = at::mm(corner_bits_, net.w1.narrow(1, config_.latent, 3).t());
  const at::Tensor hidden =
      gather_sum_leaky(batch.particles * corners, by_particle(per_particle), by_corner(per_corner), {});
  const at::Tensor messages = second_layer(net, hidden, record ? &record->fcn : nullptr);
  if (record) record->particle_input = input;
  return segment_sum(messages, batch.pair_begin, batch.pair, batch.weight).mul_(config_.p2g_scale);
}

void HgnNetwork::particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                           at::Tensor& grad_particles) const {
  const Fcn& net = fcn("particle_to_grid");
  const int64_t h = config_.latent;
  const at::Tensor messages =
      gather_rows(batch.particles * corners, {grad * config_.p2g_scale, batch.cell}, batch.weight, {});
  const at::Tensor pairs = second_layer_backward(net, record.fcn, messages);
  const at::Tensor per_particle = segment_sum_fixed(pairs, corners, {});
  at::Tensor w1_grad = net.w1_grad, b1_grad = net.b1_grad;
  at::mm_out(w1_grad, per_particle.t(), record.particle_input);
  w1_grad.narrow(1, h, 3).addmm_(sum_by_corner(pairs).t(), corner_bits_);
  at::sum_out(b1_grad, per_particle, 0);
  grad_particles.addmm_(per_particle, net.w1.narrow(1, 0, h));
}

at::Tensor HgnNetwork::grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells, const at::Tensor& particles,
                                        PairRecord* record) const {
  // Layer 1 of pair (i, k): W_c f_cell + W_p f_i + b + W_o offset_i - W_o bits_k.
  const Fcn& net = fcn("grid_to_particle");
  const int64_t h = config_.latent;
  const at::Tensor input = at::cat({particles, batch.offset}, 1);
  const at::Tensor per_particle = at::addmm(net.b1, input, net.w1.narrow(1, h, h + 3).t());
  const at::Tensor per_corner = at::mm(corner_bits_, net.w1.narrow(1, 2 * h, 3).t()).neg_();
  const at::Tensor per_cell = at::mm(cells, net.w1.narrow(1, 0, h).t());
  const at::Tensor hidden = gather_sum_leaky(batch.particles * corners, by_particle(per_particle),
                                             by_corner(per_corner), {per_cell, batch.cell});
  const at::Tensor messages = second_layer(net, hidden, record ? &record->fcn : nullptr);
  if (record) {
    record->particle_input = input;
    record->cells = cells;
  }
  return segment_sum_fixed(messages, corners, batch.weight);
}

at::Tensor HgnNetwork::grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record,
                                                 const at::Tensor& grad, at::Tensor& grad_particles) const {
  const Fcn& net = fcn("grid_to_particle");
  const int64_t h = config_.latent;
  const at::Tensor messages = gather_rows(batch.particles * corners, by_particle(grad), batch.weight, {});
  const at::Tensor pairs = second_layer_backward(net, record.fcn, messages);
  const at::Tensor per_particle = segment_sum_fixed(pairs, corners, {});
  const at::Tensor per_cell = segment_sum(pairs, batch.pair_begin, batch.pair, {});
  at::Tensor particle_part = net.w1_grad.narrow(1, h, h + 3), cell_part = net.w1_grad.narrow(1, 0, h);
  at::Tensor b1_grad = net.b1_grad;
  at::mm_out(particle_part, per_particle.t(), record.particle_input);
  net.w1_grad.narrow(1, 2 * h, 3).addmm_(sum_by_corner(pairs).t(), corner_bits_, 1, -1);
  at::mm_out(cell_part, per_cell.t(), record.cells);
  at::sum_out(b1_grad, per_particle, 0);
  grad_particles.addmm_(per_particle, net.w1.narrow(1, h, h));
  return at::mm(per_cell, net.w1.narrow(1, 0, h));
}

at::Tensor HgnNetwork::pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes,
                                     Block* record) const {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e; e is the unit vector at first, the edge latent after.
  const int64_t h = config_.latent, edges = level.sender.size(0);
  if (record) record->resize(static_cast<std::size_t>(config_.message_passing));
  at::Tensor latent;
  for (int64_t k = 0; k < config_.message_passing; ++k) {
    MessageRecord* const saved = record ? &(*record)[static_cast<std::size_t>(k)] : nullptr;
    const std::string at_k = name + "." + std::to_string(k);
    const Fcn& net = fcn(at_k + ".edge");
    const Term sender{at::mm(nodes, net.w1.narrow(1, 0, h).t()), level.sender};
    const Term receiver{at::addmm(net.b1, nodes, net.w1.narrow(1, h, h).t()), level.receiver};
    at::Tensor hidden;
    if (k == 0) {
      const at::Tensor per_slot = at::mm(slot_vector_, net.w1.narrow(1, 2 * h, 3).t());
      hidden = gather_sum_leaky(edges, sender, receiver, {per_slot, level.slot});
    } else {
      hidden = at::mm(latent, net.w1.narrow(1, 2 * h, h).t());
      gather_sum_leaky_into(hidden, sender, receiver, row_by_row(hidden));
    }
    const at::Tensor messages = second_layer(net, hidden, saved ? &saved->edge : nullptr);
    const at::Tensor received = segment_sum(messages, level.edge_begin, {}, {});
    const at::Tensor change =
        fcn_forward(fcn(at_k + ".cell"), at::cat({received, nodes}, 1), saved ? &saved->cell : nullptr);
    if (saved) {
      saved->nodes = nodes;
      saved->edges = latent;
    }
    if (k + 1 < config_.message_passing) latent = k == 0 ? messages : latent + messages;
    nodes = nodes + change;
  }
  return nodes;
}

at::Tensor HgnNetwork::pass_messages_backward(const std::string& name, const DeviceLevel& level, const Block& record,
                                              at::Tensor grad) const {
  const int64_t h = config_.latent, edges = level.sender.size(0);
  at::Tensor grad_latent;  // of the edge latents after iteration k; none after the last
  for (int64_t k = config_.message_passing; k-- > 0;) {
    const MessageRecord& saved = record[static_cast<std::size_t>(k)];
    const std::string at_k = name + "." + std::to_string(k);
    const Fcn& net = fcn(at_k + ".edge");
    const at::Tensor inputs = fcn_backward(fcn(at_k + ".cell"), saved.cell, grad);
    const at::Tensor messages = gather_rows(edges, {inputs.narrow(1, 0, h), level.receiver}, {}, grad_latent);
    const at::Tensor sums = second_layer_backward(net, saved.edge, messages);
    const at::Tensor sent = segment_sum(sums, level.edge_begin, level.reverse, {});
    const at::Tensor received = segment_sum(sums, level.edge_begin, {}, {});
    at::Tensor sender_part = net.w1_grad.narrow(1, 0, h), receiver_part = net.w1_grad.narrow(1, h, h);
    at::Tensor edge_part = net.w1_grad.narrow(1, 2 * h, k == 0 ? 3 : h), b1_grad = net.b1_grad;
    at::mm_out(sender_part, sent.t(), saved.nodes);
    at::mm_out(receiver_part, received.t(), saved.nodes);
    at::sum_out(b1_grad, received, 0);
    grad = grad + inputs.narrow(1, h, h);
    grad.addmm_(sent, net.w1.narrow(1, 0, h));
    grad.addmm_(received, net.w1.narrow(1, h, h));
    if (k == 0) {
      at::mm_out(edge_part, sums.t(), level.direction);
    } else {
      at::mm_out(edge_part, sums.t(), saved.edges);
      const at::Tensor w_edge = net.w1.narrow(1, 2 * h, h);
      grad_latent = grad_latent.defined() ? at::addmm(grad_latent, sums, w_edge) : at::mm(sums, w_edge);
    }
  }
  return grad;
}

}  // namespace graupel::train
