// A batch of scenes on the device that trains, as libtorch tensors: nodes, and who is linked to whom. Internal: only
// the .cpp files of train/ that are compiled with libtorch include this.
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "train/data/batch.h"
#include "train/data/device_samples.h"

namespace graupel::train {

/// Links between the nodes of a graph on the device.
struct DeviceLevel : graph::LevelGraph<at::Tensor> {
  at::Tensor direction;      ///< [edges, 3] unit vector from sender to receiver; between particles [edges, 4]:
                             ///< graph::edge_features
  at::Tensor parent_offset;  ///< [cells, 3] (centre of the parent - centre) / spacing
};

/// A batch on the device; see Batch.
struct DeviceBatch {
  int64_t particles = 0;
  int64_t uncounted = 0;  ///< of the particles, by the loss
  at::Tensor features, weight, offset, target;
  at::Tensor counted;       ///< [particles, 1] of the loss; undefined where it counts all
  at::Tensor type_row;      ///< [nodes] row of the embedding table
  at::Tensor type_one_hot;  ///< [nodes, embedding rows]
  at::Tensor cell, pair_begin, pair;
  std::vector<DeviceLevel> level;
};

/// To the device and in the number type of `like`; two copies, asynchronous on a GPU.
DeviceBatch upload(const Batch& batch, const at::Tensor& like);

/// A batch that was made on the device of `like`; the arrays are not copied where the number type is theirs. Without
/// offsets `direction` and `parent_offset` of cells are left out, which MixedPrecisionNetwork do not need.
DeviceBatch attach(const SampleArrays& arrays, const at::Tensor& like, bool with_offsets);

}  // namespace graupel::train
