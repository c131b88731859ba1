// Forward and backward pass of the hierarchical graph network (HGN paper, figure 2) on libtorch tensors, for a batch of
// scenes. The function is that of graph/hierarchical_graph_network.h; first layers over [f_i, f_j, e] are evaluated as
// W_i f_i + W_j f_j + W_e e, projected once per node instead of once per pair. Internal, as hgn_layers.h.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "train/batch.h"
#include "train/device_samples.h"
#include "train/hgn_layers.h"

namespace graupel::train {

/// Links of one level on the device; see BatchLevel.
struct DeviceLevel {
  int64_t cells = 0;
  at::Tensor edge_begin, sender, receiver, slot, reverse, parent, child_begin, child;
  at::Tensor direction;      ///< [edges, 3] unit vector from sender to receiver
  at::Tensor parent_offset;  ///< [cells, 3] (centre of the parent - centre) / spacing
};

/// A batch on the device; see Batch.
struct DeviceBatch {
  int64_t particles = 0;
  at::Tensor features, weight, offset, target;
  at::Tensor type_one_hot;  ///< [particles, embedding rows]
  at::Tensor cell, pair_begin, pair;
  std::vector<DeviceLevel> level;
};

/// What the backward pass needs of each part of the forward pass.
struct MessageRecord {
  FcnRecord edge, cell;
  at::Tensor nodes, edges;  ///< f and e before the iteration
};
struct PairRecord {
  FcnRecord fcn;
  at::Tensor particle_input;  ///< [particles, H + 3]
  at::Tensor cells;           ///< [cells, H]
};
struct ForwardRecord {
  FcnRecord encoder, decoder;
  PairRecord to_grid, to_particle;
  std::vector<std::vector<MessageRecord>> down, up;  ///< [level][iteration]
  std::vector<FcnRecord> restriction, prolongation;
};

class HgnNetwork {
 public:
  /// `gradient` may be undefined; then only forward() may be called.
  HgnNetwork(const graph::HgnConfig& config, const ParameterLayout& layout, const at::Tensor& flat,
             const at::Tensor& gradient);

  /// Copies a batch to the weights' device; two copies, asynchronous on a GPU.
  DeviceBatch upload(const Batch& batch) const;
  /// A batch that was made on the weights' device; the arrays are not copied.
  DeviceBatch attach(const SampleArrays& arrays) const;
  /// Normalised accelerations [particles, 3]. The record may be null.
  at::Tensor forward(const DeviceBatch& batch, ForwardRecord* record) const;
  /// Writes the gradient of every weight; `grad` is the gradient of forward()'s result.
  void backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const;

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
  at::Tensor one_hot(const at::Tensor& type_row) const;
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
