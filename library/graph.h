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

/// Positions of the last frames, newest last: what a network sees of a run.
struct NetworkHistory {
  std::vector<int32_t> particle_type;        ///< [n]
  std::vector<std::vector<Vec3f>> position;  ///< [history + 1][n] [m]
};
/// What a network makes of a history; docs/reference/networks.md tells how accelerations follow from it.
struct NetworkInput {
  std::size_t width = 0;               ///< of a row of features, without the embedding
  std::vector<float> features;         ///< [n, width]
  std::vector<int32_t> embedding_row;  ///< [n] of the tensor embedding.weight
  Vec3d grid_origin = {0, 0, 0};       ///< [m] of HGN's grid
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
  /// The scene's particles at its start with their ballistic past.
  NetworkHistory start(const Scene& scene, std::optional<uint64_t> seed = {}) const;
  /// Input of the network in a scene at time 0. Throws ConfigError for a history of another length than the network's
  /// and for particle types without an embedding.
  NetworkInput input(const Scene& scene, const NetworkHistory& history) const;
  /// Accelerations [n] [m/frame^2] of the next frame: x' = 2 x - x_before + a, before all corrections. On the CPU;
  /// throws as input().
  std::vector<Vec3f> accelerations(const Scene& scene, const NetworkHistory& history) const;
  /// What of a scene the network was not trained on, a sentence each; empty where the weights do not tell.
  std::vector<std::string> remarks(const Scene& scene) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel
