// The hierarchical graph network as its paper writes it: receivers sum the outputs of an FCN a message, and edges have
// latents of their own. Internal, as hgn_layers.h.
#pragma once

#include <string>

#include "train/networks/hgn_network.h"

namespace graupel::train {

class HgnOfMessages : public HgnNetwork {
 public:
  using HgnNetwork::HgnNetwork;

 private:
  at::Tensor particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles, PairRecord* record) const override;
  void particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                 at::Tensor& grad_particles) const override;
  at::Tensor grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells, const at::Tensor& particles,
                              PairRecord* record) const override;
  at::Tensor grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                       at::Tensor& grad_particles) const override;
  at::Tensor restrict_cells(const std::string& name, const DeviceLevel& level, const at::Tensor& cells,
                            RestrictRecord* record) const override;
  at::Tensor restrict_cells_backward(const std::string& name, const DeviceLevel& level, const RestrictRecord& record,
                                     const at::Tensor& grad) const override;
  at::Tensor pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes,
                           Block* record) const override;
  at::Tensor pass_messages_backward(const std::string& name, const DeviceLevel& level, const Block& record,
                                    at::Tensor grad) const override;
};

}  // namespace graupel::train
