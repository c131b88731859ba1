// Rollouts of the hierarchical graph network on a GPU: grids of each frame, and the network over them.
#pragma once

#include "graph/cuda/device_weights.h"
#include "graph/cuda/frame_model.h"
#include "graph/cuda/hgn_passes.h"
#include "graph/cuda/row_arena.h"
#include "graph/grid_builder.h"
#include "graph/level_places.h"

namespace graupel::graph {

class HgnFrame : public FrameModel {
 public:
  explicit HgnFrame(const nn::Weights& weights);
  ~HgnFrame() override;
  HgnFrame(const HgnFrame&) = delete;
  HgnFrame& operator=(const HgnFrame&) = delete;

  const FeatureConfig& feature_config() const override { return config_; }
  double spacing() const override { return config_.spacing; }
  void start(const Surroundings& surroundings, const std::vector<int32_t>& type_row, void* stream) override;
  float* features() override { return features_.data(); }
  Vec3f* position() override { return position_.data(); }
  void launch_graph(void* stream, bool with_counts) override;
  Room make_room() override;
  void launch(void* stream, const std::function<void()>& graph_ready) override;
  const float* output() const override { return output_.data(); }
  const int32_t* fault() const override { return places_.fault(); }
  void reuse_memory() override { arena_.reset(); }

 private:
  HgnGraph placed_graph() const;

  HgnConfig config_;
  DeviceWeights weights_;
  PackedHgn network_;
  GridBuilder builder_;
  LevelRoom room_;
  LevelPlaces places_{Device::cuda};
  RowArena arena_;
  HgnRecord record_;
  struct Streams;
  std::unique_ptr<Streams> streams_;

  int64_t particles_ = 0;
  Buffer<Vec3f> position_{Device::cuda, 0};
  Buffer<int32_t> type_row_{Device::cuda, 0};
  Buffer<float> features_{Device::cuda, 0}, output_{Device::cuda, 0};
};

}  // namespace graupel::graph
