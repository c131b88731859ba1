// Forward and backward pass of GNS on libtorch tensors, for a batch of scenes. The function is that of
// graph/networks/gns_network.h; first layers over [f_i, f_j, e] are evaluated as W_i f_i + W_j f_j + W_e e, as in
// hgn_network.h.
//
// A step keeps three arrays an edge for the backward pass, which is most of the memory of training. With checkpoints
// only the latents of every k-th step are kept, and the steps between are evaluated again on the way back.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "train/networks/network_passes.h"

namespace graupel::train {

class GnsPasses : public NetworkPasses {
 public:
  /// `checkpoint_layers` = k; 0: everything is kept.
  GnsPasses(const graph::GnsConfig& config, int64_t checkpoint_layers, const ParameterLayout& layout,
            const at::Tensor& flat, const at::Tensor& gradient);

  DeviceBatch upload(const Batch& batch) const override;
  DeviceBatch attach(const SampleArrays& arrays, bool with_offsets) const override;
  at::Tensor forward(const DeviceBatch& batch, ForwardRecord* record) const override;
  void backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const override;

 private:
  /// Latents [nodes, H] and [edges, H], or their gradients; `edge` is undefined after the last step.
  struct State {
    at::Tensor node, edge;
  };
  State step(int64_t k, const DeviceLevel& links, const State& state, MessageRecord* record) const;
  State step_backward(int64_t k, const DeviceLevel& links, const MessageRecord& record, const State& grad) const;
  State steps_backward(const DeviceLevel& links, const ForwardRecord& record, State grad) const;
  const Fcn& fcn(const std::string& name) const { return fcns_.at(name); }

  graph::GnsConfig config_;
  int64_t checkpoint_layers_;
  std::map<std::string, Fcn> fcns_;
  at::Tensor embedding_, embedding_grad_;
};

}  // namespace graupel::train
