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
  /// What earlier batches allocated is used again. On all threads.
  void start(const std::vector<CudaScene>& scenes, int64_t frames);
  /// Predicts all frames. A scene that diverges (step_frame), or of which a particle leaves what the network's grid can
  /// hold, stops alone. `progress`: frames so far of those that go on, the last ones too; what it throws ends the run.
  void run(const std::function<void(int64_t frame)>& progress = {});
  /// Of run() on the GPU, without recording what it launches.
  double seconds() const;

  /// Takes aside the frames that run() has made, until the next call: another batch may start. Their memory and that of
  /// the batch that runs take turns: each holds the frames of all scenes, 12 bytes a position.
  void keep_frames();
  /// Frames after the start that a scene of those taken aside has.
  int64_t kept_frames(std::size_t scene) const;
  /// Successive frames of a scene, on the host.
  struct FramePiece {
    std::size_t scene;
    int64_t first;                    ///< frame after the start
    std::span<const Vec3f> position;  ///< [frames, n]
  };
  /// read(pieces) until all that was taken aside is read, scene by scene and in the order of the frames; no call has
  /// two pieces of a scene. The next pieces are copied meanwhile: two times `at_once` positions, or one frame, are in
  /// pinned memory. May run on another thread beside start() and run(), but not beside keep_frames().
  void read_frames(const std::function<void(const std::vector<FramePiece>&)>& read, int64_t at_once = int64_t{1} << 21);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::graph
