// Where the moving obstacles of a scene are in each frame of a bundle, in a GPU's memory. Their arrays stay where they
// are: what was recorded once reads the poses of each bundle that it is launched for.
#pragma once

#include <cstdint>

#include "core/parallel/buffer.h"
#include "graph/cuda/rollout/pinned_buffer.h"
#include "graph/features/features.h"

namespace graupel::graph {

/// Obstacles that have moved since the frame before; null: none may have.
struct CarrierView {
  const ObstacleWay* way = nullptr;
  const int32_t* count = nullptr;
};

class BundlePoses {
 public:
  /// Of bundles of `frames`. The environment must live as long as this is used. Allocates; uploads what rests.
  void start(const Environment& environment, int64_t frames);
  /// Whether an obstacle moves.
  bool any() const { return environment_ != nullptr && environment_->moves(); }
  /// The frames that follow `time` [s], in `stream`. What was placed before must have been used.
  void place(double time, void* stream);

  // Of a frame of the bundle
  EnvironmentView environment(int64_t frame) const;
  SweptCollision swept_collision(int64_t frame) const;
  sparsegrid::ObstacleSetView obstacles(int64_t frame) const { return swept_collision(frame).obstacles; }
  CarrierView carriers(int64_t frame) const;

 private:
  /// `count` of each frame, on the host and on the device.
  template <typename T>
  struct Poses {
    PinnedBuffer<T> host;
    Buffer<T> device{Device::cuda, 0};
    std::size_t count = 0;

    void start(std::size_t of_frame, std::size_t frames) {
      count = of_frame;
      host.reserve_discard(count * frames);
      device.resize_discard(count * frames);
    }
    void set(std::size_t frame, const std::vector<T>& values) {
      std::copy(values.begin(), values.end(), host.data() + frame * count);
    }
    void upload(void* stream);
    const T* of(int64_t frame) const { return device.data() + static_cast<std::size_t>(frame) * count; }
  };

  const Environment* environment_ = nullptr;
  std::size_t frames_ = 0;
  Poses<sparsegrid::ObstacleView> obstacles_;
  Poses<RigidMap> carried_from_;
  Poses<sparsegrid::CarriedNormalsView> normals_;
  Poses<ObstacleWay> ways_;
  Poses<int32_t> way_count_;
};

}  // namespace graupel::graph
