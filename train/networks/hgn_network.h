// Forward and backward pass of the hierarchical graph network (HGN paper, figure 2) on libtorch tensors, for a batch of
// scenes: the way through the levels. What a receiver gathers is up to the form of the network (hgn_messages.h,
// hgn_activations.h). The function is that of graph/networks/hierarchical_graph_network.h. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "train/networks/hgn_gathers.h"
#include "train/networks/network_passes.h"

namespace graupel::train {

class HgnNetwork : public NetworkPasses {
 public:
  /// `gradient` may be undefined; then only forward() may be called.
  HgnNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
             const at::Tensor& gradient);

  DeviceBatch upload(const Batch& batch) const override;
  DeviceBatch attach(const SampleArrays& arrays, bool with_offsets) const override;
  at::Tensor forward(const DeviceBatch& batch, ForwardRecord* record) const override;
  void backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const override;

 protected:
  using Block = std::vector<MessageRecord>;
  /// f_c, from f_p.
  virtual at::Tensor particle_to_grid(const DeviceBatch& batch, const at::Tensor& particles,
                                      PairRecord* record) const = 0;
  /// Adds to grad_particles.
  virtual void particle_to_grid_backward(const DeviceBatch& batch, const PairRecord& record, const at::Tensor& grad,
                                         at::Tensor& grad_particles) const = 0;
  /// What is added to f_p.
  virtual at::Tensor grid_to_particle(const DeviceBatch& batch, const at::Tensor& cells, const at::Tensor& particles,
                                      PairRecord* record) const = 0;
  /// Gradient of the cells; adds to grad_particles. `grad` may be the same tensor.
  virtual at::Tensor grid_to_particle_backward(const DeviceBatch& batch, const PairRecord& record,
                                               const at::Tensor& grad, at::Tensor& grad_particles) const = 0;
  /// f of the parents of `level`'s cells.
  virtual at::Tensor restrict_cells(const std::string& name, const DeviceLevel& level, const at::Tensor& cells,
                                    RestrictRecord* record) const = 0;
  virtual at::Tensor restrict_cells_backward(const std::string& name, const DeviceLevel& level,
                                             const RestrictRecord& record, const at::Tensor& grad) const = 0;
  virtual at::Tensor pass_messages(const std::string& name, const DeviceLevel& level, at::Tensor nodes,
                                   Block* record) const = 0;
  virtual at::Tensor pass_messages_backward(const std::string& name, const DeviceLevel& level, const Block& record,
                                            at::Tensor grad) const = 0;

  const graph::HgnConfig& config() const { return config_; }
  const HgnGathers& gathers() const { return gathers_; }
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }

 private:
  /// Directions of the edges and ways to the parents.
  void add_offsets(DeviceLevel& level) const;

  graph::HgnConfig config_;
  std::map<std::string, Fcn> fcns_;
  at::Tensor embedding_, embedding_grad_;
  HgnGathers gathers_;
};

/// The network in the form that config.aggregation names.
std::unique_ptr<HgnNetwork> make_hgn(const graph::HgnConfig& config, const ParameterLayout& layout,
                                     const at::Tensor& flat, const at::Tensor& gradient);

}  // namespace graupel::train
