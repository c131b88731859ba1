#include "train/networks/hgn_gathers.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/addmm.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/neg.h>
#include <ATen/ops/sum.h>

#include <vector>

namespace graupel::train {

namespace {

/// Row r of a [pairs, .] tensor belongs to particle r / 8 and corner r % 8.
Term by_particle(const at::Tensor& table) { return {table, {}, 3, -1}; }
Term by_corner(const at::Tensor& table) { return {table, {}, 0, HgnGathers::corners - 1}; }

/// Sums of a [particles * 8, H] tensor over the particles, [8, H].
at::Tensor sum_by_corner(const at::Tensor& pairs) {
  const int64_t width = pairs.size(1);
  return at::sum(pairs.view({-1, HgnGathers::corners * width}), 0).view({HgnGathers::corners, width});
}

}  // namespace

HgnGathers::HgnGathers(int64_t latent, const at::Tensor& like) : h_(latent) {
  std::vector<float> bits, directions;
  for (int k = 0; k < corners; ++k)
    for (int d = 0; d < 3; ++d) bits.push_back(static_cast<float>((k >> d) & 1));
  // A sender at -x (slot 0) sees its receiver at +x.
  for (int slot = 0; slot < 6; ++slot)
    for (int d = 0; d < 3; ++d) directions.push_back(slot / 2 != d ? 0.0f : slot % 2 == 0 ? 1.0f : -1.0f);
  corner_bits_ = to_device(bits, like.device()).to(like.dtype()).view({corners, 3});
  slot_vector_ = to_device(directions, like.device()).to(like.dtype()).view({6, 3});
}

at::Tensor HgnGathers::from_particles(const Fcn::Layer& layer, const DeviceBatch& batch, const at::Tensor& particles,
                                      PairRecord* record) const {
  // Pair (i, k): W_f f_i + b - W_o offset_i + W_o bits_k.
  const at::Tensor input = at::cat({particles, at::neg(batch.offset)}, 1);
  const at::Tensor per_particle = at::addmm(layer.b, input, layer.w.t());
  const at::Tensor per_corner = at::mm(corner_bits_, layer.w.narrow(1, h_, 3).t());
  if (record) record->particle_input = input;
  return gather_sum_leaky(batch.particles * corners, by_particle(per_particle), by_corner(per_corner), {});
}

void HgnGathers::from_particles_backward(const Fcn::Layer& layer, const PairRecord& record, const at::Tensor& pairs,
                                         at::Tensor& grad_particles) const {
  const at::Tensor per_particle = segment_sum_fixed(pairs, corners, {});
  at::Tensor w_grad = layer.w_grad, b_grad = layer.b_grad;
  at::mm_out(w_grad, per_particle.t(), record.particle_input);
  w_grad.narrow(1, h_, 3).addmm_(sum_by_corner(pairs).t(), corner_bits_);
  at::sum_out(b_grad, per_particle, 0);
  grad_particles.addmm_(per_particle, layer.w.narrow(1, 0, h_));
}

at::Tensor HgnGathers::from_cells(const Fcn::Layer& layer, const DeviceBatch& batch, const at::Tensor& cells,
                                  const at::Tensor& particles, PairRecord* record) const {
  // Pair (i, k): W_c f_cell + W_p f_i + b + W_o offset_i - W_o bits_k.
  const at::Tensor input = at::cat({particles, batch.offset}, 1);
  const at::Tensor per_particle = at::addmm(layer.b, input, layer.w.narrow(1, h_, h_ + 3).t());
  const at::Tensor per_corner = at::mm(corner_bits_, layer.w.narrow(1, 2 * h_, 3).t()).neg_();
  const at::Tensor per_cell = at::mm(cells, layer.w.narrow(1, 0, h_).t());
  if (record) {
    record->particle_input = input;
    record->cells = cells;
  }
  return gather_sum_leaky(batch.particles * corners, by_particle(per_particle), by_corner(per_corner),
                          {per_cell, batch.cell});
}

at::Tensor HgnGathers::from_cells_backward(const Fcn::Layer& layer, const DeviceBatch& batch, const PairRecord& record,
                                           const at::Tensor& pairs, at::Tensor& grad_particles) const {
  const at::Tensor per_particle = segment_sum_fixed(pairs, corners, {});
  const at::Tensor per_cell = segment_sum(pairs, batch.pair_begin, batch.pair, {});
  at::Tensor particle_part = layer.w_grad.narrow(1, h_, h_ + 3), cell_part = layer.w_grad.narrow(1, 0, h_);
  at::Tensor b_grad = layer.b_grad;
  at::mm_out(particle_part, per_particle.t(), record.particle_input);
  layer.w_grad.narrow(1, 2 * h_, 3).addmm_(sum_by_corner(pairs).t(), corner_bits_, 1, -1);
  at::mm_out(cell_part, per_cell.t(), record.cells);
  at::sum_out(b_grad, per_particle, 0);
  grad_particles.addmm_(per_particle, layer.w.narrow(1, h_, h_));
  return at::mm(per_cell, layer.w.narrow(1, 0, h_));
}

std::array<Term, 2> HgnGathers::ends_of_edges(const Fcn::Layer& layer, const DeviceLevel& level,
                                              const at::Tensor& nodes) const {
  return {Term{at::mm(nodes, layer.w.narrow(1, 0, h_).t()), level.sender},
          Term{at::addmm(layer.b, nodes, layer.w.narrow(1, h_, h_).t()), level.receiver}};
}

at::Tensor HgnGathers::from_neighbors(const Fcn::Layer& layer, const DeviceLevel& level,
                                      const at::Tensor& nodes) const {
  const auto [sender, receiver] = ends_of_edges(layer, level, nodes);
  const at::Tensor per_slot = at::mm(slot_vector_, layer.w.narrow(1, 2 * h_, 3).t());
  return gather_sum_leaky(level.sender.size(0), sender, receiver, {per_slot, level.slot});
}

void HgnGathers::ends_of_edges_backward(const Fcn::Layer& layer, const DeviceLevel& level, const at::Tensor& nodes,
                                        const at::Tensor& edges, at::Tensor& grad_nodes) const {
  const at::Tensor sent = segment_sum(edges, level.edge_begin, level.reverse, {});
  const at::Tensor received = segment_sum(edges, level.edge_begin, {}, {});
  at::Tensor sender_part = layer.w_grad.narrow(1, 0, h_), receiver_part = layer.w_grad.narrow(1, h_, h_);
  at::Tensor b_grad = layer.b_grad;
  at::mm_out(sender_part, sent.t(), nodes);
  at::mm_out(receiver_part, received.t(), nodes);
  at::sum_out(b_grad, received, 0);
  grad_nodes.addmm_(sent, layer.w.narrow(1, 0, h_));
  grad_nodes.addmm_(received, layer.w.narrow(1, h_, h_));
}

}  // namespace graupel::train
