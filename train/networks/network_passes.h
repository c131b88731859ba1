// Forward and backward pass of a graph network on libtorch tensors, for a batch of scenes: what the architectures have
// in common. Internal, as hgn_layers.h.
#pragma once

#include <memory>
#include <vector>

#include "train/config/network_config.h"
#include "train/data/batch.h"
#include "train/data/device_samples.h"
#include "train/networks/hgn_layers.h"

namespace graupel::train {

/// Links between the nodes of a graph on the device; see BatchLevel.
struct DeviceLevel {
  int64_t cells = 0;
  at::Tensor edge_begin, sender, receiver, slot, reverse, parent, child_begin, child;
  at::Tensor direction;      ///< [edges, 3] unit vector from sender to receiver; between particles [edges, 4]:
                             ///< graph::edge_features
  at::Tensor octant;         ///< [cells] child slot
  at::Tensor parent_offset;  ///< [cells, 3] (centre of the parent - centre) / spacing
};

/// A batch on the device; see Batch.
struct DeviceBatch {
  int64_t particles = 0;
  int64_t held = 0;  ///< of the particles; the loss does not count them
  at::Tensor features, weight, offset, target;
  at::Tensor type_row;      ///< [nodes] row of the embedding table
  at::Tensor type_one_hot;  ///< [nodes, embedding rows]
  at::Tensor cell, pair_begin, pair;
  std::vector<DeviceLevel> level;
};

/// What the backward pass needs of each part of the forward pass.
struct MessageRecord {
  FcnRecord edge, cell;
  at::Tensor nodes, edges;  ///< f and e before the iteration
  at::Tensor activated;     ///< what is summed, where that is activations [edges, H]
};
struct PairRecord {
  FcnRecord fcn;
  at::Tensor particle_input;  ///< [particles, H + 3]
  at::Tensor cells;           ///< [cells, H]
  at::Tensor activated;       ///< what is summed, where that is activations [particles * 8, H]
};
struct RestrictRecord {
  FcnRecord fcn;
  at::Tensor children;   ///< input of the gather layer [fine cells, H + 3]
  at::Tensor activated;  ///< what is summed, where that is activations [fine cells, H]
};
struct ForwardRecord {
  FcnRecord encoder, decoder;
  PairRecord to_grid, to_particle;
  std::vector<std::vector<MessageRecord>> down, up;  ///< [level][iteration]
  std::vector<RestrictRecord> restriction;
  std::vector<FcnRecord> prolongation;
  FcnRecord edge_encoder;           ///< of GNS
  std::vector<MessageRecord> step;  ///< of GNS
};

class NetworkPasses {
 public:
  virtual ~NetworkPasses() = default;

  /// Copies a batch to the weights' device; two copies, asynchronous on a GPU.
  virtual DeviceBatch upload(const Batch& batch) const = 0;
  /// A batch that was made on the weights' device; the arrays are not copied. Without offsets `direction` and
  /// `parent_offset` of HGN are left out, which MixedPasses do not need.
  virtual DeviceBatch attach(const SampleArrays& arrays, bool with_offsets) const = 0;
  /// Normalised accelerations [particles, 3 k] of the next k frames. The record may be null.
  virtual at::Tensor forward(const DeviceBatch& batch, ForwardRecord* record) const = 0;
  /// Writes the gradient of every weight; `grad` is the gradient of forward()'s result.
  virtual void backward(const DeviceBatch& batch, const ForwardRecord& record, const at::Tensor& grad) const = 0;
};

/// The passes of a network whose weights lie in `flat`. `gradient` may be undefined; then only forward() may be called.
std::unique_ptr<NetworkPasses> make_passes(const NetworkConfig& config, int64_t checkpoint_layers,
                                           const ParameterLayout& layout, const at::Tensor& flat,
                                           const at::Tensor& gradient);

/// The two arrays of a batch on the device, and its parts.
class UploadedBatch {
 public:
  /// To the device and in the number type of `like`; two copies, asynchronous on a GPU.
  UploadedBatch(const Batch& batch, const at::Tensor& like);
  at::Tensor index(const Part& part) const { return indices_.narrow(0, part.begin, part.count); }
  at::Tensor numbers(const Part& part) const { return numbers_.narrow(0, part.begin, part.count); }
  at::Tensor rows(const Part& part, int64_t width) const { return numbers(part).view({-1, width}); }
  /// Particles, features, target and types; no links.
  DeviceBatch particles(const Batch& batch) const;
  /// Links between particles and their features.
  DeviceLevel links(const BatchLevel& level, const Part& edge_features) const;

 private:
  at::Tensor indices_, numbers_;
};

/// One copy of a host array to the device, through page-locked memory on the way to a GPU.
at::Tensor to_device(const std::vector<float>& values, const at::Device& device);
at::Tensor to_device(const std::vector<int32_t>& values, const at::Device& device);
/// Arrays of a SampleArrays as tensors beside `like`, not copied where it is of the same number type: [rows, width],
/// and whole numbers.
at::Tensor attached(const float* data, int64_t rows, int64_t width, const at::Tensor& like);
at::Tensor attached(const int32_t* data, int64_t count, const at::Tensor& like);
/// Links between particles and their features.
DeviceLevel attached_links(const SampleArrays& arrays, const at::Tensor& like);
/// [rows, embedding rows] in the type of `number`, from rows of the embedding table.
at::Tensor one_hot(const at::Tensor& type_row, at::ScalarType number);

}  // namespace graupel::train
