// Rollouts of GNS on a GPU: the radius graph of each frame with its obstacle particles, and the network over it.
#pragma once

#include "graph/cuda/forward/device_weights.h"
#include "graph/cuda/forward/message_forward.h"
#include "graph/cuda/forward/row_arena.h"
#include "graph/cuda/rollout/frame_model.h"
#include "graph/topology/radius_graph_builder.h"

namespace graupel::graph {

class GnsFrame : public FrameModel, private EdgeMemory {
 public:
  explicit GnsFrame(const nn::Weights& weights);

  const FeatureConfig& feature_config() const override { return config_; }
  double spacing() const override { return config_.radius; }
  void start(const std::vector<Range>& scenes, const std::vector<int32_t>& type_row, void* stream) override;
  void launch_graph(void* stream, bool with_counts) override;
  CapacityStatus ensure_capacity() override;
  void launch(void* stream, const LaunchHooks& moments) override;
  const float* output() const override { return output_.data(); }
  const int32_t* fault() const override { return builder_.links().fault; }
  void reuse_memory() override { arena_.reset(); }

 private:
  void make_graph(void* stream);
  uint16_t* latent(int64_t) override { return latent_.data(); }
  uint16_t* message() override { return message_.data(); }

  GnsConfig config_;
  FeatureRules rules_;
  DeviceWeights weights_;
  PackedNetwork network_;
  RadiusGraphBuilder builder_{Device::cuda, config_};
  RowArena arena_;
  MessageRecord record_;
  void* stream_ = nullptr;  ///< of the graph made last
  bool is_due_ = false;     ///< the graph is made by launch(), after the features

  int64_t particles_ = 0;
  Buffer<uint16_t> latent_{Device::cuda, 0}, message_{Device::cuda, 0};  ///< [edges, 128]
  Buffer<Vec3f> point_{Device::cuda, 0};                                 ///< obstacle particles, near or not
  Buffer<float> output_{Device::cuda, 0};
};

}  // namespace graupel::graph
