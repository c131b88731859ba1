// What changes in small scenes during a frame, known before it: poses of moving obstacles in each substep and the nodes
// that they may hold, ends of the substeps. Made on the host, brought to the device in one copy.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "mpm/gpu/small/small_scene_view.h"
#include "mpm/scene/scene_setup.h"

namespace graupel::mpm {

class FrameTables {
 public:
  /// Throws ConfigError when a fixed step is too long for a script or an emitter. The scenes outlive the tables.
  FrameTables(const std::vector<std::unique_ptr<SceneSetup<float>>>& scenes, Device device);

  /// Makes the tables of the frame after `frames_done`, unless they are there. `controls`: of the scenes now.
  void make(int64_t frames_done, const std::vector<SceneProgress>& controls);
  /// The same during the frame before, where the substeps do not depend on how that ends.
  void make_early(int64_t frames_done, const std::vector<SceneProgress>& controls);
  /// The scenes are in another state.
  void discard() { made_for_ = -1; }
  /// Brings them to the device; whether the scenes or their tables moved there.
  bool upload();
  /// [scenes] on the device.
  const ChangingScene* scenes() const { return reinterpret_cast<const ChangingScene*>(tables_.data()); }
  int64_t bytes() const { return static_cast<int64_t>(tables_.size() + held_.size() * sizeof(NodeContact)); }

 private:
  /// Of one scene; empty where nothing moves, or nothing comes and goes.
  struct Frame {
    int32_t substeps = 0;
    ObstacleSteps<float> obstacles;
    std::vector<NodeBox> boxes;  ///< [substeps, moving ones]
    int64_t held = 0;            ///< most nodes of the boxes of a substep
    std::vector<double> step_end;
    std::vector<ScriptStep<float>> scripts;  ///< [substeps, scripts]
    CarriedAffine<float> carried;
  };
  Frame frame_of(const SceneSetup<float>& scene, int64_t frames_done, double speed) const;

  const std::vector<std::unique_ptr<SceneSetup<float>>>& scenes_;
  std::vector<Frame> frames_;
  int64_t made_for_ = -1;  ///< frames done before the one of these tables
  bool known_early_ = true;
  std::vector<std::byte> packed_;
  Buffer<std::byte> tables_;  ///< ChangingScene [scenes], then what they point to
  Buffer<NodeContact> held_;
};

}  // namespace graupel::mpm
