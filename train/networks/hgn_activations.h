// The hierarchical graph network whose receivers sum activations (docs/decisions/0011-sums-of-activations.md):
//   s_j = sum over messages of w a(W_g [f_i, f_j, offset] + b_g),   then FCN(s_j) or FCN([s_j, f_j]) once a receiver.
// Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <string>

#include "train/networks/hgn_network.h"

namespace graupel::train {

class HgnOfActivations : public HgnNetwork {
 public:
  HgnOfActivations(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
                   const at::Tensor& gradient)
      : HgnNetwork(config, layout, flat, gradient), layers_(bind_gathers(layout, flat, gradient)) {}

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
  const Fcn::Layer& gather(const std::string& name) const { return layers_.at(name + ".gather"); }

  std::map<std::string, Fcn::Layer> layers_;
};

}  // namespace graupel::train
