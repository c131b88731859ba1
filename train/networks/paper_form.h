// Forward pass of the graph networks as the papers write them, in libtorch's own operations alone: first layers over
// concatenated inputs, once a pair or an edge. What a user of libtorch writes, to be timed beside Graupel's engines
// and to check the passes of training, which take those layers apart. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <string>

#include "train/networks/network_passes.h"

namespace graupel::train {

class WholeNetwork {
 public:
  /// Of the weights in `flat`.
  WholeNetwork(const NetworkConfig& config, const ParameterLayout& layout, const at::Tensor& flat);

  /// Normalised accelerations [particles, 3 k], as NetworkPasses::forward.
  at::Tensor forward(const DeviceBatch& batch) const;

 private:
  at::Tensor apply(const std::string& name, const at::TensorList& inputs) const;
  /// Of networks that sum activations.
  at::Tensor gather(const std::string& name, const at::TensorList& inputs) const;
  at::Tensor to_grid(const graph::HgnConfig& config, const DeviceBatch& batch, const at::Tensor& of_pair,
                     const at::Tensor& offset) const;
  at::Tensor to_coarse(const graph::HgnConfig& config, const std::string& name, const DeviceLevel& level,
                       const at::Tensor& cells) const;
  at::Tensor to_particles(const graph::HgnConfig& config, const DeviceBatch& batch, const at::Tensor& cells,
                          const at::Tensor& particles, const at::Tensor& of_pair, const at::Tensor& offset) const;
  at::Tensor hgn(const graph::HgnConfig& config, const DeviceBatch& batch, const at::Tensor& particles) const;
  at::Tensor gns(const graph::GnsConfig& config, const DeviceBatch& batch, at::Tensor nodes) const;
  at::Tensor pass_activations(const graph::HgnConfig& config, const std::string& name, const DeviceLevel& level,
                              at::Tensor nodes) const;
  at::Tensor pass_messages(const graph::HgnConfig& config, const std::string& name, const DeviceLevel& level,
                           at::Tensor nodes) const;

  NetworkConfig config_;
  std::map<std::string, Fcn> fcns_;
  std::map<std::string, Fcn::Layer> gathers_;
  at::Tensor embedding_;
};

}  // namespace graupel::train
