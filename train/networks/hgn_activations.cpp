#include "train/networks/hgn_activations.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/leaky_relu.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/sum.h>

namespace graupel::train {

namespace {
constexpr int corners = HgnGathers::corners;
}

at::Tensor HgnOfActivations::particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles,
                                              PairRecord* record) const {
  const std::string name = "particle_to_grid";
  const at::Tensor activated = gathers().from_particles(gather(name), batch, particles, record);
  const at::Tensor sums = segment_sum(activated, batch.pair_begin, batch.pair, batch.weight).mul_(config().p2g_scale);
  if (record) record->activated = activated;
  return fcn_forward(fcn(name), sums, record ? &record->fcn : nullptr);
}

void HgnOfActivations::particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record,
                                                 const at::Tensor& grad, at::Tensor& grad_particles) const {
  const std::string name = "particle_to_grid";
  const at::Tensor sums = fcn_backward(fcn(name), record.fcn, grad).mul_(config().p2g_scale);
  const at::Tensor pairs = gather_rows(batch.particles * corners, {sums, batch.cell}, batch.weight, {});
  activation_backward(record.activated, pairs);
  gathers().from_particles_backward(gather(name), record, pairs, grad_particles);
}

at::Tensor HgnOfActivations::grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells,
                                              const at::Tensor& particles, PairRecord* record) const {
  const std::string name = "grid_to_particle";
  const at::Tensor activated = gathers().from_cells(gather(name), batch, cells, particles, record);
  const at::Tensor sums = segment_sum_fixed(activated, corners, batch.weight);
  if (record) record->activated = activated;
  return fcn_forward(fcn(name), at::cat({sums, particles}, 1), record ? &record->fcn : nullptr);
}

at::Tensor HgnOfActivations::grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record,
                                                       const at::Tensor& grad, at::Tensor& grad_particles) const {
  const std::string name = "grid_to_particle";
  const int64_t h = config().latent;
  const at::Tensor inputs = fcn_backward(fcn(name), record.fcn, grad);
  grad_particles.add_(inputs.narrow(1, h, h));
  const at::Tensor pairs =
      gather_rows(batch.particles * corners, {inputs.narrow(1, 0, h), {}, 3, -1}, batch.weight, {});
  activation_backward(record.activated, pairs);
  return gathers().from_cells_backward(gather(name), batch, record, pairs, grad_particles);
}

at::Tensor HgnOfActivations::restrict_cells(const std::string& name, const DeviceLevel& level, const at::Tensor& cells,
                                            RestrictRecord* record) const {
  const Fcn::Layer& layer = gather(name);
  const at::Tensor children = at::cat({cells, level.parent_offset}, 1);
  at::Tensor activated = at::addmm(layer.b, children, layer.w.t());
  at::leaky_relu_(activated, leaky_slope);
  if (record) {
    record->children = children;
    record->activated = activated;
  }
  return fcn_forward(fcn(name), segment_sum(activated, level.child_begin, level.child, {}),
                     record ? &record->fcn : nullptr);
}

at::Tensor HgnOfActivations::restrict_cells_backward(const std::string& name, const DeviceLevel& level,
                                                     const RestrictRecord& record, const at::Tensor& grad) const {
  const Fcn::Layer& layer = gather(name);
  const at::Tensor sums = fcn_backward(fcn(name), record.fcn, grad);
  const at::Tensor children = gather_rows(level.cells, {sums, level.parent}, {}, {});
  activation_backward(record.activated, children);
  at::Tensor w_grad = layer.w_grad, b_grad = layer.b_grad;
  at::mm_out(w_grad, children.t(), record.children);
  at::sum_out(b_grad, children, 0);
  return at::mm(children, layer.w.narrow(1, 0, config().latent));
}

at::Tensor HgnOfActivations::pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes,
                                           Block* record) const {
  if (record) record->resize(static_cast<std::size_t>(config().message_passing));
  for (int64_t k = 0; k < config().message_passing; ++k) {
    MessageRecord* const saved = record ? &(*record)[static_cast<std::size_t>(k)] : nullptr;
    const std::string at_k = name + "." + std::to_string(k);
    const at::Tensor activated = gathers().from_neighbors(gather(at_k), level, nodes);
    const at::Tensor sums = segment_sum(activated, level.edge_begin, {}, {});
    const at::Tensor change =
        fcn_forward(fcn(at_k + ".cell"), at::cat({sums, nodes}, 1), saved ? &saved->cell : nullptr);
    if (saved) {
      saved->nodes = nodes;
      saved->activated = activated;
    }
    nodes = nodes + change;
  }
  return nodes;
}

at::Tensor HgnOfActivations::pass_messages_backward(const std::string& name, const DeviceLevel& level,
                                                    const Block& record, at::Tensor grad) const {
  const int64_t h = config().latent;
  for (int64_t k = config().message_passing; k-- > 0;) {
    const MessageRecord& saved = record[static_cast<std::size_t>(k)];
    const std::string at_k = name + "." + std::to_string(k);
    const Fcn::Layer& layer = gather(at_k);
    const at::Tensor inputs = fcn_backward(fcn(at_k + ".cell"), saved.cell, grad);
    const at::Tensor edges = gather_rows(level.sender.size(0), {inputs.narrow(1, 0, h), level.receiver}, {}, {});
    activation_backward(saved.activated, edges);
    at::Tensor offset_part = layer.w_grad.narrow(1, 2 * h, 3);
    at::mm_out(offset_part, edges.t(), level.direction);
    grad = grad + inputs.narrow(1, h, h);
    gathers().ends_of_edges_backward(layer, level, saved.nodes, edges, grad);
  }
  return grad;
}

}  // namespace graupel::train
