// Rollouts of the hierarchical graph network on a GPU: grids of each frame, beside the stream of the rest, and the
// network over them in the form that its weights ask for.
#pragma once

#include "graph/cuda/forward/grid_network.h"
#include "graph/cuda/rollout/frame_model.h"

namespace graupel::graph {

class HgnFrame : public FrameModel {
 public:
  explicit HgnFrame(const nn::Weights& weights);
  ~HgnFrame() override;
  HgnFrame(const HgnFrame&) = delete;
  HgnFrame& operator=(const HgnFrame&) = delete;

  const FeatureConfig& feature_config() const override { return config_; }
  double spacing() const override { return config_.spacing; }
  void start(const std::vector<Range>& scenes, const std::vector<int32_t>& type_row, void* stream) override;
  bool takes_scenes() const override { return config_.aggregation == Aggregation::activations; }
  std::vector<std::size_t> scenes_outside() override;
  void launch_graph(void* stream, bool with_counts) override;
  CapacityStatus ensure_capacity() override;
  void launch(void* stream, const LaunchHooks& moments) override;
  const float* output() const override { return network_->output(); }
  const int32_t* fault() const override { return network_->fault(); }
  void reuse_memory() override { network_->reset(); }

 private:
  struct Streams;

  HgnConfig config_;
  std::unique_ptr<GridNetwork> network_;
  GridBuilder builder_;
  LevelCapacity capacity_;
  std::unique_ptr<Streams> streams_;
  std::vector<SceneGrid> scenes_;
};

}  // namespace graupel::graph
