// The linear layers of the hierarchical graph network over what a receiver gathers, [f_i, f_j, offset], with their
// activation, forward and backward. They are evaluated as W_i f_i + W_j f_j + W_o offset + b, projected once a node
// instead of once a pair. Of a network of messages they are the first layers of its FCNs. Internal, as hgn_layers.h.
#pragma once

#include <array>

#include "train/networks/network_passes.h"

namespace graupel::train {

class HgnGathers {
 public:
  static constexpr int corners = 8;

  /// H, and the device and type of the weights.
  HgnGathers(int64_t latent, const at::Tensor& like);

  /// a(W [f_p, (centre - x)/R] + b), [particles * 8, H]. A record keeps the input.
  at::Tensor from_particles(const Fcn::Layer& layer, const DeviceBatch& batch, const at::Tensor& particles,
                            PairRecord* record) const;
  /// `pairs` is the gradient of what enters the activation. Fills the layer's gradients, adds to grad_particles.
  void from_particles_backward(const Fcn::Layer& layer, const PairRecord& record, const at::Tensor& pairs,
                               at::Tensor& grad_particles) const;

  /// a(W [f_cell, f_p, (x - centre)/R] + b), [particles * 8, H].
  at::Tensor from_cells(const Fcn::Layer& layer, const DeviceBatch& batch, const at::Tensor& cells,
                        const at::Tensor& particles, PairRecord* record) const;
  /// The same as from_particles_backward; returns the gradient of the cells.
  at::Tensor from_cells_backward(const Fcn::Layer& layer, const DeviceBatch& batch, const PairRecord& record,
                                 const at::Tensor& pairs, at::Tensor& grad_particles) const;

  /// W_s f_sender and W_r f_receiver + b as terms of a sum over edges.
  std::array<Term, 2> ends_of_edges(const Fcn::Layer& layer, const DeviceLevel& level, const at::Tensor& nodes) const;
  /// a(W [f_sender, f_receiver, unit vector] + b), [edges, H].
  at::Tensor from_neighbors(const Fcn::Layer& layer, const DeviceLevel& level, const at::Tensor& nodes) const;
  /// Gradients of W_s, W_r and b from that of what enters the activation; adds to the gradient of the nodes.
  void ends_of_edges_backward(const Fcn::Layer& layer, const DeviceLevel& level, const at::Tensor& nodes,
                              const at::Tensor& edges, at::Tensor& grad_nodes) const;

  const at::Tensor& slot_vector() const { return slot_vector_; }

 private:
  int64_t h_;
  at::Tensor corner_bits_;  ///< [8, 3] 0 or 1
  at::Tensor slot_vector_;  ///< [6, 3] unit vector from sender to receiver
};

}  // namespace graupel::train
