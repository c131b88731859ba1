// Forward and backward pass of the hierarchical graph network (HGN paper, figure 2) on libtorch tensors, for a batch of
// scenes. The function is that of graph/hierarchical_graph_network.h; first layers over [f_i, f_j, e] are evaluated as
// W_i f_i + W_j f_j + W_e e, projected once per node instead of once per pair. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "train/network_passes.h"

namespace graupel::train {

class HgnNetwork : public NetworkPasses {
 public:
  /// `gradient` may be undefined; then only forward() may be called.
  HgnNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
             const at::Tensor& gradient);

  DeviceBatch upload(const Batch& batch) const override;
  DeviceBatch attach(const SampleArrays& arrays) const override;
  at::Tensor forward(const DeviceBatch& batch, ForwardRecord* record) const override;
  void backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const override;

 private:
  using Block = std::vector<MessageRecord>;
  at::Tensor particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles, PairRecord* record) const;
  void particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                 at::Tensor& grad_particles) const;
  at::Tensor grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells, const at::Tensor& particles,
                              PairRecord* record) const;
  at::Tensor grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                       at::Tensor& grad_particles) const;
  at::Tensor pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes, Block* record) const;
  at::Tensor pass_messages_backward(const std::string& name, const DeviceLevel& level, const Block& record,
                                    at::Tensor grad) const;
  /// Directions of the edges and ways to the parents.
  void add_offsets(DeviceLevel& level, const at::Tensor& octant) const;
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }

  graph::HgnConfig config_;
  std::map<std::string, Fcn> fcns_;
  at::Tensor embedding_, embedding_grad_;
  at::Tensor corner_bits_;  ///< [8, 3] 0 or 1
  at::Tensor slot_vector_;  ///< [6, 3] unit vector from sender to receiver
};

}  // namespace graupel::train
