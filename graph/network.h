// What the graph networks have in common: the accelerations of particles, from their last positions.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "graph/config/feature_config.h"
#include "graph/features/features.h"
#include "nn/weights.h"

namespace graupel::graph {

/// Seconds of one predicted frame, by part; `hierarchy` is the building of the graph, whatever its form. What is done
/// once for a block of frames (FeatureConfig::bundle) counts in equal parts for each of them.
struct FrameTiming {
  double features = 0, hierarchy = 0, network = 0, projection = 0;
  /// Of the caller's clock, from one frame to the next without handing it out: with all that lies between the parts.
  /// The first frame of a bundle has all that the bundle waits for.
  double wall = 0;
  double total() const { return features + hierarchy + network + projection; }
  /// What each of so many frames has of it.
  FrameTiming shared_by(int64_t frames) const {
    const double fraction = 1 / static_cast<double>(frames);
    return {fraction * features, fraction * hierarchy, fraction * network, fraction * projection};
  }
};

/// Evaluates a network's layers in place of the CPU's engine: normalised accelerations [n, output_width()] from
/// features [n, features], types and positions [n]. `origin` is that of HGN's grid.
using NetworkEngine =
    std::function<void(const std::vector<float>& features, const std::vector<int32_t>& particle_type,
                       const std::vector<Vec3f>& position, const Vec3d& origin, std::vector<float>& acceleration)>;

class Network {
 public:
  virtual ~Network() = default;

  virtual const FeatureConfig& feature_config() const = 0;
  virtual const Normalization& normalization() const = 0;
  /// R [m]: cell size of the finest level, or radius of the graph.
  virtual double spacing() const = 0;

  /// Normalised accelerations [n, output_width()] of the next feature_config().bundle frames of particles of the given
  /// types [n], from history + 1 positions [n], newest last. `environment` is that of the frame to come. Across
  /// periodic walls particles see each other as far as their images reach (graph/features/periodic_images.h).
  /// `material` [n]: indices into environment.materials, or no_material; read by networks that see constants alone.
  /// Fills in the parts of `timing` that it knows. May be called from several threads. Throws InputError for a particle
  /// type that is not known.
  virtual std::vector<float> predict(const Environment& environment, const std::vector<int32_t>& particle_type,
                                     const std::vector<int32_t>& material,
                                     const std::vector<std::vector<Vec3f>>& positions, FrameTiming& timing,
                                     const NetworkEngine* engine = nullptr) const = 0;

  /// Floating-point operations of an evaluation, for particles at `position` (graph/plan/layer_plan.h).
  virtual double flop(const Environment& environment, const std::vector<Vec3f>& position) const = 0;
};

/// The network of a weights file, by its "architecture". Throws InputError for an unknown one and for damaged weights.
std::shared_ptr<const Network> load_network(const nn::Weights& weights);

}  // namespace graupel::graph
