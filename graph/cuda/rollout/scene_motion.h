// What of a rollout on a GPU belongs to one scene: its frames, their features, the motion by the network's
// accelerations and the corrections. The network's arrays may hold the rows of several scenes.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/parallel/buffer.h"
#include "graph/config/feature_config.h"
#include "graph/corrections/density_projection.h"
#include "graph/corrections/free_flight.h"
#include "graph/cuda/rollout/bundle_poses.h"
#include "graph/cuda_simulator.h"
#include "graph/features/normalization.h"

namespace graupel::graph {

/// What a frame leaves for the host.
struct FrameStatus {
  int32_t newest;    ///< frame of the ring
  int32_t diverged;  ///< the frame after it; further ones leave all as it is
  int32_t fault;     ///< the last frame's output was of no use
  int32_t finished;  ///< particles of the frame that is being made
};

struct FrameRing;

class SceneMotion {
 public:
  /// Of networks whose cells or radius are of `spacing` [m].
  SceneMotion(const FeatureConfig& config, const Normalization& normalization, double spacing);
  ~SceneMotion();
  SceneMotion(const SceneMotion&) = delete;
  SceneMotion& operator=(const SceneMotion&) = delete;

  /// The scene's rows in the network's arrays.
  struct Rows {
    Vec3f* position;       ///< [particles] of the newest frame
    float* features;       ///< [particles, features]
    const float* output;   ///< [particles, output_width()]
    const int32_t* fault;  ///< where it is not 0 the output is of no use
  };
  /// Frames that a rollout starts from.
  int64_t start_frames() const { return config_.history + 1; }
  /// The host's part of a start, on any thread: writes the frames to `start` [start_frames(), particles], in pinned
  /// memory. Scene and `start` must stay as they are until the launches of start() are done, scene and environment as
  /// long as it runs.
  void prepare(const CudaScene& scene, Vec3f* start);
  /// Begins a rollout of what was prepared. `ring` [start_frames() + frames, particles], in the GPU's memory, keeps the
  /// last `frames` frames beside the start; `position` becomes the newest one. What earlier rollouts allocated is used
  /// again. In `stream`; waits for nothing where the memory suffices.
  void start(Vec3f* ring, int64_t frames, Vec3f* position, void* stream);
  int64_t particles() const { return particles_; }
  /// Whether place() must be called before the launches of each bundle.
  bool moves() const { return poses_.any(); }
  /// Puts moving obstacles where they are in the frames of the bundle that follows `time` [s]. In `stream`; the
  /// launches for the bundle before must be done.
  void place(double time, void* stream) { poses_.place(time, stream); }

  // Launches of all scenes, which may be recorded
  struct Placed {
    SceneMotion* motion;
    Rows rows;
  };
  static void launch_features(const std::vector<Placed>& scenes, void* stream);
  /// Groups of what flies in the newest frame.
  static void launch_groups(const std::vector<Placed>& scenes, void* stream);
  bool finds_groups() const { return laws_.free_flight; }
  /// From the newest frame to the next one, by the accelerations of a frame of the bundle. Groups of the first one are
  /// those of launch_groups(). The density is held after the last one.
  static void launch_move(const std::vector<Placed>& scenes, int64_t frame, void* stream);

  /// As the last frame left it: it may be read while others run.
  const volatile FrameStatus& status() const { return *seen_; }
  /// No further frames, as if the next one diverged: all particles lie at `place`. Waits.
  void stop(const Vec3f& place, Vec3f* position);
  int32_t ring_frames() const { return ring_frames_; }
  const Vec3f* frame(int32_t of_ring) const { return ring_ + of_ring * particles_; }
  /// Of accelerations; without a network gravity alone.
  Normalization real_statistics() const;

 private:
  FrameRing ring();
  /// A frame of the bundle, as launch_move() corrects it.
  FreeFlight::Frame flight_frame(const Rows& rows, int64_t frame);
  /// Where obstacles of some scene move, and where all rest.
  template <bool AmongMoving>
  static void launch_move_of(const std::vector<Placed>& scenes, int64_t frame, void* stream);

  FeatureConfig config_;
  Normalization normalization_;
  double spacing_;
  const Scene* scene_ = nullptr;
  const Environment* environment_ = nullptr;
  const std::vector<int32_t>*particle_type_ = nullptr, *materials_ = nullptr;  ///< until start()
  const Vec3f* start_ = nullptr;                                               ///< the same
  CudaLaws laws_;
  bool continues_ = false;  ///< CudaScene::continues
  BundlePoses poses_;
  double largest_density_ = 0;  ///< [particles/m^3]; 0: any
  int64_t particles_ = 0;
  int32_t ring_frames_ = 0;
  Buffer<int32_t> material_{Device::cuda, 0};  ///< [particles], of networks that see constants
  Vec3f* ring_ = nullptr;                      ///< [ring_frames, particles]
  Buffer<FrameStatus> status_{Device::cuda, 1};
  FrameStatus* seen_ = nullptr;  ///< the status on the host
  /// The frame before the newest; the one to come, until it is the newest.
  Buffer<Vec3f> before_{Device::cuda, 0}, next_{Device::cuda, 0};
  std::optional<FreeFlight> flight_;          ///< of use where finds_groups()
  std::optional<DensityProjection> density_;  ///< of use where there is a largest density
};

}  // namespace graupel::graph
