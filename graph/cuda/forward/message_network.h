// HGN that sums messages on a GPU, for rollouts: message_forward.h on the links of one scene.
#pragma once

#include "core/parallel/buffer.h"
#include "graph/cuda/forward/device_weights.h"
#include "graph/cuda/forward/grid_network.h"
#include "graph/cuda/forward/message_forward.h"
#include "graph/cuda/forward/row_arena.h"

namespace graupel::graph {

class MessageNetwork : public GridNetwork {
 public:
  MessageNetwork(const HgnConfig& config, const nn::Weights& weights);
  void prepare(const GridInputs& inputs) override;
  void reset() override { arena_.reset(); }
  void follow_grid(void* grid_stream) override;
  void launch(void* stream, const LaunchHooks& moments) override;
  const float* output() const override { return output_.data(); }
  const int32_t* fault() const override { return places_.fault(); }

 private:
  NetworkGraph graph() const;

  DeviceWeights weights_;
  PackedNetwork network_;
  MessageRecord record_;
  GridInputs inputs_;
  FixedCapacityLevels places_{Device::cuda};
  RowArena arena_;
  Buffer<float> output_{Device::cuda, 0};
};

}  // namespace graupel::graph
