// Rollouts of many scenes at once on a GPU: the rows of all scenes run through one launch of each network, their
// features, motion and corrections beside each other. Each scene has the bits that CudaSimulator gives it alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "graph/cuda_simulator.h"

namespace graupel::graph {

class CudaBatch {
 public:
  /// Of HGN that aggregates activations: its sums do not depend on the rows beside them. The weights must live as long.
  /// Throws ConfigError where there is no GPU or no kernels for such a network.
  explicit CudaBatch(const nn::Weights& weights);
  ~CudaBatch();

  /// Rollouts of `frames` frames of scenes with particles, the same lower corner of the domain and laws with a network.
  void start(const std::vector<CudaScene>& scenes, int64_t frames);
  /// Predicts all frames. A scene that diverges (step_frame), or of which a particle leaves what the network's grid can
  /// hold, stops alone. `progress`: frames so far of those that go on; what it throws ends the run.
  void run(const std::function<void(int64_t frame)>& progress = {});
  /// Of run() on the GPU, without recording what it launches.
  double seconds() const;
  /// Positions [frames that the scene has, n] after the start. Valid until the next call.
  std::span<const Vec3f> frames(std::size_t scene) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::graph
