// Rollouts of graph networks on a GPU: features, graph, network and projection run there, and the positions stay
// there. The function is that of LearnedSimulator on the CPU, with matrix products in bf16.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/scene/scene.h"
#include "graph/features/features.h"
#include "nn/weights.h"

namespace graupel::graph {

/// Milliseconds of one frame on the GPU, a share of those of its bundle (FeatureConfig::bundle). The hierarchy is made
/// beside the features and, where receivers sum messages, the encoder: what it takes longer than they.
struct CudaFrameTime {
  double features = 0, hierarchy = 0, network = 0, projection = 0;
  double total() const { return features + hierarchy + network + projection; }
};

/// As in LearnedSimulator::RolloutOptions.
struct CudaLaws {
  bool project = true;
  double density_limit = 1;
  bool free_flight = true;
  bool network = true;
};

/// A scene and its history + 1 positions, newest last. Scene and environment must live as long as it runs. Its
/// obstacles may move, but not those of networks that see obstacles as particles.
struct CudaScene {
  const Scene* scene;
  const Environment* environment;
  const std::vector<int32_t>* particle_type;  ///< [n]
  const std::vector<int32_t>* material;  ///< [n] as Network::predict has it; empty for networks that see no constants
  const std::vector<std::vector<Vec3f>>* positions;  ///< [history + 1 or more][n]
  CudaLaws laws;
  double time = 0;  ///< [s] of the newest position; of use where obstacles move
  /// Positions [m] whose density is that at rest; null: the newest ones.
  const std::vector<Vec3f>* matter = nullptr;
  /// The rollout before goes on with other particles: density at rest and pressures stay.
  bool continues = false;
  bool brief = false;  ///< few frames follow: their launches are not worth a recording
};

class CudaSimulator {
 public:
  /// Throws ConfigError where there is no GPU or no kernels for such a network.
  explicit CudaSimulator(const nn::Weights& weights);
  ~CudaSimulator();

  void start(const CudaScene& scene);
  /// Predicts the next frame; false when it has diverged (step_frame) or a particle has left the domain's environment.
  bool advance();
  /// Accelerations of the next frame [m/frame^2], without moving. After start() alone.
  std::vector<Vec3f> accelerations();
  /// The network alone, as NetworkEngine has it (graph/network.h): normalised accelerations [n, output_width()] from
  /// features [n, features] and positions [n] in host memory. Ends a rollout.
  void evaluate(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& output);
  std::vector<Vec3f> positions() const;
  /// Of the last frame, by events on the GPU.
  CudaFrameTime frame_time() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace graupel::graph
