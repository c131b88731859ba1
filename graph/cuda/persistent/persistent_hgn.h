// The hierarchical graph network that sums activations (hgn.aggregation = activations) on a GPU, for rollouts: all its
// networks over rows in one launch (graph/cuda/persistent/persistent_layers.h). Each makes what the next one gathers:
// first layers of gatherings are linear in [f_sender, f_receiver, offset], so a row is projected once.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/cuda/aggregation/pair_aggregation.h"
#include "graph/cuda/forward/device_weights.h"
#include "graph/cuda/forward/grid_network.h"
#include "graph/cuda/persistent/persistent_layers.h"

namespace graupel::graph {

class PersistentHgn : public GridNetwork {
 public:
  /// Whether the kernels exist for such a network: width 128, few enough features.
  static bool fits(const HgnConfig& config);

  PersistentHgn(const HgnConfig& config, const nn::Weights& weights);
  PersistentHgn(const PersistentHgn&) = delete;
  PersistentHgn& operator=(const PersistentHgn&) = delete;

  void prepare(const GridInputs& inputs) override;
  void follow_grid(void* grid_stream) override;
  void launch(void* stream, const LaunchHooks& moments) override;
  const float* output() const override { return output_.data(); }
  const int32_t* fault() const override { return range_.data() + 2; }

 private:
  /// A network and where its weights begin in the arrays of all.
  struct Planned {
    PersistentLayer network{};
    std::size_t tiles = 0, vectors = 0, table = none, addend = none, offsets = none;
  };
  static constexpr std::size_t none = SIZE_MAX;
  class Planner;

  bool has_own_decoder() const { return config_.bundle > 1; }
  void pack_decoder(const nn::Weights& weights);
  void launch_decoder(void* stream);

  HgnConfig config_;
  std::vector<Planned> plan_;  ///< in the order in which they run, without their rows
  Buffer<uint16_t> tiles_{Device::cuda, 0};
  Buffer<float> tables_{Device::cuda, 0}, vectors_{Device::cuda, 0};
  Buffer<PersistentLayer> networks_{Device::cuda, 0};
  Buffer<uint32_t> done_{Device::cuda, 0};
  Buffer<int32_t> range_{Device::cuda, 0};  ///< 0, particles; fault
  Buffer<float> latents_{Device::cuda, 0}, output_{Device::cuda, 0};
  Buffer<uint16_t> projections_{Device::cuda, 0};
  PairAggregation pair_aggregation_{};
  Buffer<float> part_sums_{Device::cuda, 0};
  Buffer<int32_t> part_begins_{Device::cuda, 0};  ///< of PairParts
  /// The weights for a decoder of several frames at once, which has a launch of its own; its W1 as a tile.
  std::optional<DeviceWeights> decoder_;
  Buffer<uint16_t> decoder_tile_{Device::cuda, 0};
  const int32_t* overflow_ = nullptr;
  std::vector<int64_t> most_rows_;  ///< of each network
  int64_t particles_ = 0;
};

}  // namespace graupel::graph
