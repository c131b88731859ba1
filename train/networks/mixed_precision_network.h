// Forward and backward pass of a graph network in mixed precision on a GPU, by graph/cuda/fused_mlp/row_layers.h:
// products in bf16 with f32 sums, weights in f32. Internal, as
// device_batch.h.
#pragma once

#include <memory>

#include "train/config/network_config.h"
#include "train/networks/device_batch.h"
#include "train/networks/parameter_layout.h"

namespace graupel::train {

class MixedPrecisionNetwork {
 public:
  virtual ~MixedPrecisionNetwork() = default;
  /// Normalised accelerations [particles, 3 k]; keeps what backward() needs until the next call.
  virtual at::Tensor forward(const DeviceBatch& batch) = 0;
  /// Writes the gradient of every weight; `grad` is the gradient of forward()'s result.
  virtual void backward(const DeviceBatch& batch, const at::Tensor& grad) = 0;
};

/// The passes of a network whose weights and their gradient lie in flat arrays on a GPU; null where there are none for
/// such a network, of HGN that sums messages and in a build without CUDA. Throws ConfigError for a GNS of several
/// hidden layers.
std::unique_ptr<MixedPrecisionNetwork> make_mixed_precision_network(const NetworkConfig& config,
                                                                    int64_t checkpoint_layers,
                                                                    const ParameterLayout& layout,
                                                                    const at::Tensor& flat, const at::Tensor& gradient);

}  // namespace graupel::train
