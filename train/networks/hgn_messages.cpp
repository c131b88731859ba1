#include "train/networks/hgn_messages.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/mm.h>

namespace graupel::train {

namespace {
constexpr int corners = HgnGathers::corners;
}

at::Tensor HgnOfMessages::particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles,
                                           PairRecord* record) const {
  const Fcn& net = fcn("particle_to_grid");
  const at::Tensor hidden = gathers().from_particles(net.first(), batch, particles, record);
  const at::Tensor messages = second_layer(net, hidden, record ? &record->fcn : nullptr);
  return segment_sum(messages, batch.pair_begin, batch.pair, batch.weight).mul_(config().p2g_scale);
}

void HgnOfMessages::particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record,
                                              const at::Tensor& grad, at::Tensor& grad_particles) const {
  const Fcn& net = fcn("particle_to_grid");
  const at::Tensor messages =
      gather_rows(batch.particles * corners, {grad * config().p2g_scale, batch.cell}, batch.weight, {});
  gathers().from_particles_backward(net.first(), record, second_layer_backward(net, record.fcn, messages),
                                    grad_particles);
}

at::Tensor HgnOfMessages::grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells,
                                           const at::Tensor& particles, PairRecord* record) const {
  const Fcn& net = fcn("grid_to_particle");
  const at::Tensor hidden = gathers().from_cells(net.first(), batch, cells, particles, record);
  return segment_sum_fixed(second_layer(net, hidden, record ? &record->fcn : nullptr), corners, batch.weight);
}

at::Tensor HgnOfMessages::grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record,
                                                    const at::Tensor& grad, at::Tensor& grad_particles) const {
  const Fcn& net = fcn("grid_to_particle");
  const at::Tensor messages = gather_rows(batch.particles * corners, {grad, {}, 3, -1}, batch.weight, {});
  return gathers().from_cells_backward(net.first(), batch, record, second_layer_backward(net, record.fcn, messages),
                                       grad_particles);
}

at::Tensor HgnOfMessages::restrict_cells(const std::string& name, const DeviceLevel& level, const at::Tensor& cells,
                                         RestrictRecord* record) const {
  const at::Tensor children =
      fcn_forward(fcn(name), at::cat({cells, level.parent_offset}, 1), record ? &record->fcn : nullptr);
  return segment_sum(children, level.child_begin, level.child, {});
}

at::Tensor HgnOfMessages::restrict_cells_backward(const std::string& name, const DeviceLevel& level,
                                                  const RestrictRecord& record, const at::Tensor& grad) const {
  const at::Tensor children = gather_rows(level.cells, {grad, level.parent}, {}, {});
  return fcn_backward(fcn(name), record.fcn, children).narrow(1, 0, config().latent);
}

at::Tensor HgnOfMessages::pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes,
                                        Block* record) const {
  // Layer 1 of edge s -> r: W_s f_s + W_r f_r + b + W_e e; e is the unit vector at first, the edge latent after.
  const int64_t h = config().latent;
  if (record) record->resize(static_cast<std::size_t>(config().message_passing));
  at::Tensor latent;
  for (int64_t k = 0; k < config().message_passing; ++k) {
    MessageRecord* const saved = record ? &(*record)[static_cast<std::size_t>(k)] : nullptr;
    const std::string at_k = name + "." + std::to_string(k);
    const Fcn& net = fcn(at_k + ".edge");
    at::Tensor hidden;
    if (k == 0) {
      hidden = gathers().from_neighbors(net.first(), level, nodes);
    } else {
      hidden = at::mm(latent, net.w1.narrow(1, 2 * h, h).t());
      const auto [sender, receiver] = gathers().ends_of_edges(net.first(), level, nodes);
      gather_sum_leaky_into(hidden, sender, receiver, {hidden, {}, 0, -1});
    }
    const at::Tensor messages = second_layer(net, hidden, saved ? &saved->edge : nullptr);
    const at::Tensor received = segment_sum(messages, level.edge_begin, {}, {});
    const at::Tensor change =
        fcn_forward(fcn(at_k + ".cell"), at::cat({received, nodes}, 1), saved ? &saved->cell : nullptr);
    if (saved) {
      saved->nodes = nodes;
      saved->edges = latent;
    }
    if (k + 1 < config().message_passing) latent = k == 0 ? messages : latent + messages;
    nodes = nodes + change;
  }
  return nodes;
}

at::Tensor HgnOfMessages::pass_messages_backward(const std::string& name, const DeviceLevel& level, const Block& record,
                                                 at::Tensor grad) const {
  const int64_t h = config().latent, edges = level.sender.size(0);
  at::Tensor grad_latent;  // of the edge latents after iteration k; none after the last
  for (int64_t k = config().message_passing; k-- > 0;) {
    const MessageRecord& saved = record[static_cast<std::size_t>(k)];
    const std::string at_k = name + "." + std::to_string(k);
    const Fcn& net = fcn(at_k + ".edge");
    const at::Tensor inputs = fcn_backward(fcn(at_k + ".cell"), saved.cell, grad);
    const at::Tensor messages = gather_rows(edges, {inputs.narrow(1, 0, h), level.receiver}, {}, grad_latent);
    const at::Tensor sums = second_layer_backward(net, saved.edge, messages);
    at::Tensor edge_part = net.w1_grad.narrow(1, 2 * h, k == 0 ? 3 : h);
    grad = grad + inputs.narrow(1, h, h);
    gathers().ends_of_edges_backward(net.first(), level, saved.nodes, sums, grad);
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
