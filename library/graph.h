// Graph networks (HGN, GNS) that roll scenes out without a solver: the public face of graph/.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/parallel/device.h"
#include "core/scene/scene.h"
#include "core/scene/trajectory.h"
#include "core/system/error.h"

namespace graupel {

struct NetworkRollout {
  Device device = Device::cpu;
  std::optional<int64_t> frames = {};  ///< after the first; else the scene's
  std::optional<uint64_t> seed = {};   ///< of the particle sampling; else the scene's
  bool keep_out = true;                ///< move particles out of obstacles and into the walls
  double density_limit = 1;            ///< largest density, of that at rest; 0: none; in space alone
  bool free_flight = true;             ///< keep the momentum of what flies freely
  /// Called after every frame; what it throws ends the rollout.
  std::function<void(int64_t frame)> progress = {};
};

/// The network of a weights file, for any number of scenes. On a GPU not to be used from several threads at once.
class NetworkModel {
 public:
  /// Throws InputError for a file that is missing, damaged or holds no graph network.
  explicit NetworkModel(const std::string& weights_file);
  NetworkModel(NetworkModel&&) noexcept;
  NetworkModel& operator=(NetworkModel&&) noexcept;
  ~NetworkModel();

  /// Frames from the scene's start on, whose past is ballistic, with velocities as differences of frames. A rollout
  /// that blows up stops before that frame and says so in diverged_at_frame. Throws ConfigError for a scene with
  /// another frame time or obstacle spacing than the network's, and for what a network cannot run.
  Trajectory rollout(const Scene& scene, const NetworkRollout& options = {}) const;
  /// What of a scene the network was not trained on, a sentence each; empty where the weights do not tell.
  std::vector<std::string> remarks(const Scene& scene) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel
