#include "graph/cuda/rollout/hgn_frame.h"

#include <string>

#include "core/parallel/cuda_check.h"
#include "core/system/error.h"
#include "graph/networks/graph_network.h"

namespace graupel::graph {

namespace {

constexpr int margin = 3;  ///< cells around a scene's box that the grid can hold

HgnConfig checked_config(const nn::Weights& weights) {
  static_cast<void>(GraphNetwork(weights));  // its errors
  if (!cuda_available()) throw ConfigError("device 'cuda' is not usable (no GPU). Use --device cpu");
  return HgnConfig::from_metadata(weights.metadata, weights.file);
}

}  // namespace

/// The stream of the grid, beside that of the encoder.
struct HgnFrame::Streams {
  Streams() {
    GRAUPEL_CUDA_CHECK(cudaStreamCreate(&grid));
    for (cudaEvent_t* event : {&begun, &grid_there})
      GRAUPEL_CUDA_CHECK(cudaEventCreateWithFlags(event, cudaEventDisableTiming));
  }
  ~Streams() {
    for (cudaEvent_t event : {begun, grid_there}) cudaEventDestroy(event);
    cudaStreamDestroy(grid);
  }
  Streams(const Streams&) = delete;
  Streams& operator=(const Streams&) = delete;
  cudaStream_t grid = nullptr;
  cudaEvent_t begun = nullptr, grid_there = nullptr;
};

HgnFrame::HgnFrame(const nn::Weights& weights)
    : config_(checked_config(weights)),
      network_(make_grid_network(config_, weights)),
      builder_(Device::cuda, config_.spacing, static_cast<int>(config_.levels), margin,
               config_.aggregation == Aggregation::messages),
      streams_(std::make_unique<Streams>()) {}
HgnFrame::~HgnFrame() = default;

void HgnFrame::start(const std::vector<Range>& scenes, const std::vector<int32_t>& type_row, void* stream) {
  GRAUPEL_ASSERT(scenes.size() == 1 || (takes_scenes() && !scenes.empty()));
  capacity_ = {};
  scenes_.clear();
  for (const Range& scene : scenes) {
    GRAUPEL_ASSERT(scene.origin == scenes.front().origin);
    scenes_.push_back({scene.origin, scene.low, scene.high, scene.particles});
  }
  type_row_.upload(type_row);
  features_.resize_discard(type_row.size() * static_cast<std::size_t>(config_.input_width() - config_.embedding));
  position_.resize_discard(type_row.size());
  builder_.prepare(scenes_, stream);
}

std::vector<std::size_t> HgnFrame::scenes_outside() {
  GridBuilder alone(Device::cuda, config_.spacing, static_cast<int>(config_.levels), margin, /*with_edges=*/false);
  std::vector<std::size_t> outside;
  const Vec3f* position = position_.data();
  for (std::size_t s = 0; s < scenes_.size(); ++s) {
    alone.prepare({scenes_[s]}, streams_->grid);
    alone.build(position, streams_->grid, /*with_counts=*/true);
    if (alone.counts(streams_->grid).overflow) outside.push_back(s);
    position += scenes_[s].particles;
  }
  return outside;
}

void HgnFrame::launch_graph(void* stream, bool with_counts) {
  GRAUPEL_CUDA_CHECK(cudaEventRecord(streams_->begun, static_cast<cudaStream_t>(stream)));
  GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(streams_->grid, streams_->begun, 0));
  builder_.build(position_.data(), streams_->grid, with_counts);
}

FrameModel::CapacityStatus HgnFrame::ensure_capacity() {
  const GridCounts counts = builder_.counts(streams_->grid);
  if (counts.overflow) return CapacityStatus::exceeded;
  if (capacity_.holds(counts)) return CapacityStatus::sufficient;
  capacity_ = LevelCapacity::for_counts(counts);
  std::vector<int64_t> particles_of_scene;
  for (const SceneGrid& scene : scenes_) particles_of_scene.push_back(scene.particles);
  network_->prepare({static_cast<int64_t>(type_row_.size()), particles_of_scene, features_.data(), type_row_.data(),
                     position_.data(), scenes_.front().origin, builder_.links(), capacity_});
  return CapacityStatus::reallocated;
}

void HgnFrame::launch(void* stream, const LaunchHooks& moments) {
  network_->follow_grid(streams_->grid);
  GRAUPEL_CUDA_CHECK(cudaEventRecord(streams_->grid_there, streams_->grid));
  network_->launch(
      stream, {[&] {
                 GRAUPEL_CUDA_CHECK(cudaStreamWaitEvent(static_cast<cudaStream_t>(stream), streams_->grid_there, 0));
                 moments.graph_ready();
               },
               moments.room_beside});
}

}  // namespace graupel::graph
